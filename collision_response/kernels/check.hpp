// What is wrong with a request, and which geometry it needs: see validity.cpp.in.
#pragma once

extern "C" void check_everything(const double* input, double* fault, bool* flags);
extern "C" void check_articulated(const double* input, double* fault, bool* flags);
