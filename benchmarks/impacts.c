/* Many impacts in plain C, for comparison with a batch.
 *
 * The arrays are those of resolve_batch with SPATIAL geometry: one row per quantity, both bodies of a pair next to each
 * other. The tensor of each body is inverted here. Nothing is checked, and only velocities and impulses are reported.
 * Compiled twice: with `cc -O3 -march=native`, and tuned, with `-fno-math-errno -fno-trapping-math` too. Without these
 * two options no root and no choice is vectorised.
 */

#include <math.h>
#include <stddef.h>

typedef struct { double x, y, z; } Vec;
typedef struct { double xx, xy, xz, yy, yz, zz; } Tensor; /* symmetric */
typedef struct { double inverse_mass; Vec r, v, w; Tensor inverse_inertia; } Body;

#define INLINE static inline __attribute__((always_inline))

INLINE Vec plus(Vec a, Vec b) { return (Vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE Vec minus(Vec a, Vec b) { return (Vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE Vec times(Vec a, double s) { return (Vec){a.x * s, a.y * s, a.z * s}; }
INLINE double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE Vec cross(Vec a, Vec b)
{
    return (Vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
INLINE Vec apply(Tensor t, Vec v)
{
    return (Vec){t.xx * v.x + t.xy * v.y + t.xz * v.z, t.xy * v.x + t.yy * v.y + t.yz * v.z,
                 t.xz * v.x + t.yz * v.y + t.zz * v.z};
}
INLINE Tensor inverse(Tensor t) /* by cofactors: one division */
{
    double xx = t.yy * t.zz - t.yz * t.yz, xy = t.xz * t.yz - t.xy * t.zz, xz = t.xy * t.yz - t.xz * t.yy;
    double s = 1 / (t.xx * xx + t.xy * xy + t.xz * xz);
    return (Tensor){xx * s, xy * s, xz * s, (t.xx * t.zz - t.xz * t.xz) * s, (t.xy * t.xz - t.xx * t.yz) * s,
                    (t.xx * t.yy - t.xy * t.xy) * s};
}

#define ROW(array, row) (array)[(size_t)(row) * n + i]
#define OF(array, row, side) ROW(array, 2 * (row) + (side))
#define VEC(array, row) (Vec){ROW(array, row), ROW(array, (row) + 1), ROW(array, (row) + 2)}
#define VEC_OF(row) (Vec){OF(bodies, row, side), OF(bodies, (row) + 1, side), OF(bodies, (row) + 2, side)}

INLINE Body body(const double *bodies, size_t n, size_t i, int side, Vec point)
{
    Tensor inertia = {OF(bodies, 1, side), OF(bodies, 2, side), OF(bodies, 3, side),
                      OF(bodies, 4, side), OF(bodies, 5, side), OF(bodies, 6, side)};
    return (Body){1 / OF(bodies, 0, side), minus(point, VEC_OF(7)), VEC_OF(10), VEC_OF(13), inverse(inertia)};
}

INLINE void apply_impulse(double *velocity, double *spin, size_t n, size_t i, int side, Body b, Vec P)
{
    Vec v = plus(b.v, times(P, b.inverse_mass)), w = plus(b.w, apply(b.inverse_inertia, cross(b.r, P)));
    OF(velocity, 0, side) = v.x, OF(velocity, 1, side) = v.y, OF(velocity, 2, side) = v.z;
    OF(spin, 0, side) = w.x, OF(spin, 1, side) = w.y, OF(spin, 2, side) = w.z;
}

/* -[r]x I^-1 [r]x: its columns are (I^-1 (r x e)) x r. */
INLINE Tensor add_inverse_effective_mass(Tensor K, Body b)
{
    Vec r = b.r;
    Vec x = cross(apply(b.inverse_inertia, (Vec){0, r.z, -r.y}), r);
    Vec y = cross(apply(b.inverse_inertia, (Vec){-r.z, 0, r.x}), r);
    Vec z = cross(apply(b.inverse_inertia, (Vec){r.y, -r.x, 0}), r);
    double m = b.inverse_mass;
    return (Tensor){K.xx + m + x.x, K.xy + x.y, K.xz + x.z, K.yy + m + y.y, K.yz + y.z, K.zz + m + z.z};
}

#define IMPACTS(LAW)                                                                                        \
    void LAW##_impacts(size_t n, const double *restrict bodies, const double *restrict contacts,            \
                       double *restrict velocity, double *restrict spin, double *restrict impulse)          \
    {                                                                                                       \
        _Pragma("GCC ivdep") for (size_t i = 0; i < n; i++) {                                               \
            Vec point = VEC(contacts, 0), normal = VEC(contacts, 3);                                        \
            Body a = body(bodies, n, i, 0, point), b = body(bodies, n, i, 1, point);                        \
            Vec u = minus(plus(a.v, cross(a.w, a.r)), plus(b.v, cross(b.w, b.r)));                          \
            double n_u = dot(normal, u);                                                                    \
            Vec P = LAW(a, b, normal, u, n_u, ROW(contacts, 6), contacts, n, i);                            \
            P = times(P, n_u < 0 ? 1.0 : 0.0);                                                              \
            apply_impulse(velocity, spin, n, i, 0, a, P);                                                   \
            apply_impulse(velocity, spin, n, i, 1, b, times(P, -1));                                        \
            ROW(impulse, 0) = P.x, ROW(impulse, 1) = P.y, ROW(impulse, 2) = P.z;                            \
        }                                                                                                   \
    }

INLINE Vec frictionless(Body a, Body b, Vec normal, Vec u, double n_u, double e, const double *contacts, size_t n,
                        size_t i)
{
    Vec l_a = cross(a.r, normal), l_b = cross(b.r, normal);
    double n_Kn = dot(normal, normal) * (a.inverse_mass + b.inverse_mass) + dot(l_a, apply(a.inverse_inertia, l_a)) +
                  dot(l_b, apply(b.inverse_inertia, l_b));
    return times(normal, -(1 + e) * n_u / n_Kn);
}

/* Chatterjee & Ruina, with e_t = 0. */
INLINE Vec coulomb(Body a, Body b, Vec normal, Vec u, double n_u, double e, const double *contacts, size_t n,
                   size_t i)
{
    double mu = ROW(contacts, 7);
    Tensor K = add_inverse_effective_mass(add_inverse_effective_mass((Tensor){0, 0, 0, 0, 0, 0}, a), b);
    Vec Kn = apply(K, normal);
    double j = -n_u / dot(normal, Kn), nn = dot(normal, normal);
    Vec D = times(apply(inverse(K), plus(u, times(Kn, j))), -1);
    double D_n = dot(normal, D) / nn;
    Vec D_t = minus(D, times(normal, D_n));
    double slip = dot(D_t, D_t) / nn, length = sqrt(slip), reach = mu * ((1 + e) * j + D_n);
    double on_cone = mu * (1 + e) * j / (length - mu * D_n);
    double kappa = (reach >= 0) & (length <= reach) ? 1 : on_cone;
    return plus(times(normal, (1 + e) * j), times(D, kappa));
}

IMPACTS(frictionless)
IMPACTS(coulomb)
