/* The limit that a batch is measured against: frictionless impacts as plain C does them.
 *
 * Spatial bodies with a tensor in world axes, solved here by L D L^T; the arrays of resolve_batch,
 * component-major, both bodies of a pair on one axis. No row is checked, nothing is reported but the
 * velocities and the impulse. Compile with -O3 -march=native.
 */

#include <stddef.h>

#define ROW(array, row) (array + (size_t)(row) * n)
#define BODY(row, lane) ROW(bodies, 2 * (row) + (lane))

#define KERNEL(NAME, REAL)                                                                             \
    void NAME(size_t n, const REAL *restrict bodies, const REAL *restrict contacts,                    \
              REAL *restrict velocity, REAL *restrict angular_velocity, REAL *restrict impulse)        \
    {                                                                                                  \
        _Pragma("GCC ivdep") for (size_t i = 0; i < n; i++) {                                          \
            REAL n_x = ROW(contacts, 3)[i], n_y = ROW(contacts, 4)[i], n_z = ROW(contacts, 5)[i];      \
            REAL s_x[2], s_y[2], s_z[2], k[2], w_n[2], m[2];                                           \
            _Pragma("GCC unroll 2") for (int l = 0; l < 2; l++) {                                      \
                REAL r_x = ROW(contacts, 0)[i] - BODY(7, l)[i];                                        \
                REAL r_y = ROW(contacts, 1)[i] - BODY(8, l)[i];                                        \
                REAL r_z = ROW(contacts, 2)[i] - BODY(9, l)[i];                                        \
                REAL a_x = r_y * n_z - r_z * n_y, a_y = r_z * n_x - r_x * n_z, a_z = r_x * n_y - r_y * n_x; \
                REAL xx = BODY(1, l)[i], xy = BODY(2, l)[i], xz = BODY(3, l)[i];                       \
                REAL yy = BODY(4, l)[i], yz = BODY(5, l)[i], zz = BODY(6, l)[i];                       \
                REAL i_x = 1 / xx, l_yx = xy * i_x, l_zx = xz * i_x;                                   \
                REAL i_y = 1 / (yy - l_yx * xy), w = yz - l_zx * xy, l_zy = w * i_y;                   \
                REAL i_z = 1 / (zz - l_zx * xz - l_zy * w);                                            \
                REAL y = a_y - l_yx * a_x, z = (a_z - l_zx * a_x - l_zy * y) * i_z;                    \
                y = y * i_y - l_zy * z;                                                                \
                s_x[l] = a_x * i_x - l_yx * y - l_zx * z, s_y[l] = y, s_z[l] = z;                      \
                k[l] = a_x * s_x[l] + a_y * y + a_z * z;                                               \
                w_n[l] = BODY(13, l)[i] * a_x + BODY(14, l)[i] * a_y + BODY(15, l)[i] * a_z;           \
                m[l] = 1 / BODY(0, l)[i];                                                              \
            }                                                                                          \
            REAL n_u = n_x * (BODY(10, 0)[i] - BODY(10, 1)[i]) + n_y * (BODY(11, 0)[i] - BODY(11, 1)[i]) \
                       + n_z * (BODY(12, 0)[i] - BODY(12, 1)[i]) + w_n[0] - w_n[1];                    \
            REAL nn = n_x * n_x + n_y * n_y + n_z * n_z;                                               \
            REAL j = -(1 + ROW(contacts, 6)[i]) * n_u / (nn * (m[0] + m[1]) + k[0] + k[1]);            \
            j = n_u < 0 ? j : 0;                                                                       \
            _Pragma("GCC unroll 2") for (int l = 0; l < 2; l++) {                                      \
                REAL p = l ? -j : j;                                                                   \
                ROW(velocity, l)[i] = BODY(10, l)[i] + p * m[l] * n_x;                                 \
                ROW(velocity, 2 + l)[i] = BODY(11, l)[i] + p * m[l] * n_y;                             \
                ROW(velocity, 4 + l)[i] = BODY(12, l)[i] + p * m[l] * n_z;                             \
                ROW(angular_velocity, l)[i] = BODY(13, l)[i] + p * s_x[l];                             \
                ROW(angular_velocity, 2 + l)[i] = BODY(14, l)[i] + p * s_y[l];                         \
                ROW(angular_velocity, 4 + l)[i] = BODY(15, l)[i] + p * s_z[l];                         \
            }                                                                                          \
            ROW(impulse, 0)[i] = j * n_x, ROW(impulse, 1)[i] = j * n_y, ROW(impulse, 2)[i] = j * n_z;  \
        }                                                                                              \
    }

KERNEL(impacts_float64, double)
KERNEL(impacts_float32, float)
