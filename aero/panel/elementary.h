/* Logarithm and arctangent of two arguments without branches, which compilers vectorise.

   Both are exact to a few units in the last place and the same on every machine: IEEE arithmetic, no contraction. */

#ifndef ELEMENTARY_H
#define ELEMENTARY_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

#define PI 3.14159265358979323846
#define HALF_PI 1.57079632679489661923
#define QUARTER_PI 0.78539816339744830962
#define LOG_2 0.69314718055994530942
#define TAN_EIGHTH_PI 0.41421356237309504880
#define ROOT_HALF_BITS INT64_C(0x3fe6a09e667f3bcd) /* of sqrt(1/2) */

/* log(x) of a positive normal number: x = 2^k m with m in [sqrt(1/2), sqrt(2)), log m = 2 artanh((m - 1) / (m + 1)).
   The polynomial interpolates artanh(s) / s at the Chebyshev points of s^2; its error is 1e-18. */
INLINE double logarithm(double x)
{
    uint64_t bits, shifted, fraction, exponent;
    double m, k, s, z, p;
    memcpy(&bits, &x, sizeof bits);
    shifted = bits + ((UINT64_C(1023) << 52) - (uint64_t)ROOT_HALF_BITS);
    fraction = (shifted & UINT64_C(0x000fffffffffffff)) + (uint64_t)ROOT_HALF_BITS;
    exponent = (shifted >> 52) | UINT64_C(0x4330000000000000); /* the double 2^52 + biased exponent */
    memcpy(&m, &fraction, sizeof m);
    memcpy(&k, &exponent, sizeof k);
    k -= 4503599627370496.0 + 1023.0;
    s = (m - 1.0) / (m + 1.0);
    z = s * s;
    p = 0.07404855180327638;
    p = p * z + 0.07656264074182095;
    p = p * z + 0.09091815840114664;
    p = p * z + 0.11111098528363024;
    p = p * z + 0.1428571438032084;
    p = p * z + 0.1999999999965117;
    p = p * z + 0.33333333333333826;
    return k * LOG_2 + 2.0 * (s + s * z * p);
}

/* The angle of the point (x, y), from -pi to pi; 0 at the origin. An angle up to pi/8 within an eighth of the circle by
   the polynomial that interpolates arctan(t) / t at the Chebyshev points of t^2, whose error is 1e-18. */
INLINE double arctangent(double y, double x)
{
    double ax = fabs(x), ay = fabs(y);
    double low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
    int large = low > TAN_EIGHTH_PI * high;
    double t = (large ? low - high : low) / (large ? low + high : (high > 0.0 ? high : 1.0));
    double z = t * t, p = -0.017805397205419446;
    p = p * z + 0.03796525745386593;
    p = p * z - 0.05035102456601552;
    p = p * z + 0.05846878297330872;
    p = p * z - 0.06662951813629191;
    p = p * z + 0.07692045330902225;
    p = p * z - 0.09090896809064027;
    p = p * z + 0.11111110744919658;
    p = p * z - 0.14285714279250245;
    p = p * z + 0.19999999999940893;
    p = p * z - 0.3333333333333312;
    p = t + t * z * p;
    p = large ? QUARTER_PI + p : p;
    p = ax < ay ? HALF_PI - p : p;
    p = x < 0.0 ? PI - p : p;
    return copysign(p, y);
}

#endif
