// What is wrong with a request, and which geometries it needs: see validity.py and geometry.py.
#include "validity_everything.hpp"

extern "C" void check_request(const double* x, double* fault, bool* shapes) {
  validity<double>(x, nullptr, fault, shapes);
}
