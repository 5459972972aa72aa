#ifndef PHI_FILE_LANE_FUNCTIONS_DOUBLE
#define PHI_FILE_LANE_FUNCTIONS_DOUBLE
#include <math.h>
#include <stdint.h>
#include <string.h>

#if PHI_CALLS_EXP || PHI_CALLS_EXPM1 || PHI_CALLS_SIN || PHI_CALLS_COS
#define PHI_ROUNDER 6755399441055744.0 /* 1.5 * 2^52: adding it rounds to integers */

#endif
/* Compute exp(u) - 2^k and *power = 2^k, where k is the integer nearest to u / log 2; branch-free. */
static inline double phi_exp_parts(double u, double *power)
{
    const double shifted = u * 1.4426950408889634 + PHI_ROUNDER, k = shifted - PHI_ROUNDER;
    const double r = (u - k * 0.6931471803691238) - k * 1.9082149292705877e-10, rr = r * r;
    uint64_t bits; /* the bits of `shifted`; the lowest bits are the integer k */
    double sum = 1.1470745597729725e-11, other = 1.6059043836821613e-10;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 1023) << 52;
    memcpy(power, &bits, sizeof *power);
    sum = sum * rr + 2.08767569878681e-09;
    other = other * rr + 2.505210838544172e-08;
    sum = sum * rr + 2.755731922398589e-07;
    other = other * rr + 2.7557319223985893e-06;
    sum = sum * rr + 2.48015873015873e-05;
    other = other * rr + 0.0001984126984126984;
    sum = sum * rr + 0.001388888888888889;
    other = other * rr + 0.008333333333333333;
    sum = sum * rr + 0.041666666666666664;
    other = other * rr + 0.16666666666666666;
    sum = (sum * r + other) * r + 0.5;
    sum = sum * rr + r;
    return *power * sum;
}

/* exp(u) for vectorised loops. NaN for |u| > 700. */
static inline double phi_exp_lane(double u)
{
    double power;
    const double rest = phi_exp_parts(u, &power);
    return rest + power + (fabs(u) <= 700.0 ? 0.0 : (double)NAN);
}

/* exp(u) - 1 for vectorised loops. NaN for |u| > 700. */
static inline double phi_expm1_lane(double u)
{
    double power;
    const double rest = phi_exp_parts(u, &power);
    return rest + (power - 1.0) + (fabs(u) <= 700.0 ? 0.0 : (double)NAN);
}

/* log u for vectorised loops: u = 2^k m with m between sqrt 1/2 and sqrt 2; branch-free. NaN unless u is positive and
   normal. */
static inline double phi_log_lane(double u)
{
    uint64_t bits, exponent, digits;
    double m, k, sum = 0.043478260869565216, other = 0.047619047619047616;
    memcpy(&bits, &u, sizeof bits);
    exponent = (bits - 0x3fe6a09e667f3bcdU + 0x3ff0000000000000U) >> 52; /* k + 1023, the biased exponent of 2^k */
    digits = bits - ((exponent - 1023) << 52);
    memcpy(&m, &digits, sizeof m);
    exponent |= 0x4330000000000000U; /* 2^52 + k + 1023, as a double */
    memcpy(&k, &exponent, sizeof k);
    k -= 4503599627371519.0;
    const double f = (m - 1.0) / (m + 1.0), q = f * f, qq = q * q;
    sum = sum * qq + 0.05263157894736842;
    other = other * qq + 0.058823529411764705;
    sum = sum * qq + 0.06666666666666667;
    other = other * qq + 0.07692307692307693;
    sum = sum * qq + 0.09090909090909091;
    other = other * qq + 0.1111111111111111;
    sum = sum * qq + 0.14285714285714285;
    other = other * qq + 0.2;
    sum = (sum * q + other) * q + 0.3333333333333333;
    /* m - 1 is exact; the terms in low are small compared with it */
    const double low = q * sum * 2.0 * f + k * 1.9082149292705877e-10;
    const double rest = (m - 1.0) - f * (m - 1.0) + low + k * 0.6931471803691238;
    return rest + (u >= 2.2250738585072014e-308 && u <= 1.7976931348623157e308 ? 0.0 : (double)NAN);
}

#if PHI_CALLS_SIN && !PHI_CALLS_COS
/* sin u for vectorised loops: u = k pi + r with |r| <= pi/2; branch-free. NaN for |u| > 10^8. */
static inline double phi_sin_lane(double u)
{
    const double shifted = u * 0.3183098861837907 + PHI_ROUNDER, k = shifted - PHI_ROUNDER;
#elif PHI_CALLS_COS
/* sin(u + offset pi) for offset 0 or 0.5: u = (k - offset) pi + r with |r| <= pi/2; branch-free. NaN for |u| > 10^8. */
static inline double phi_turned_sin(double u, double offset)
{
    const double shifted = (u * 0.3183098861837907 + offset) + PHI_ROUNDER, k = (shifted - PHI_ROUNDER) - offset;
#endif
#if PHI_CALLS_SIN || PHI_CALLS_COS
    const double reduced = (u - k * 3.141592651605606) - k * 1.9841871479187034e-09;
    const double r = reduced - k * 1.1442377452219664e-17, q = r * r, qq = q * q;
    uint64_t parity, bits; /* bits of `shifted`; the last bit is the parity of k */
    double value, sum = -3.868170170630684e-23, other = 1.9572941063391263e-20;
    sum = sum * qq + -8.22063524662433e-18;
    other = other * qq + 2.8114572543455206e-15;
    sum = sum * qq + -7.647163731819816e-13;
    other = other * qq + 1.6059043836821613e-10;
    sum = sum * qq + -2.505210838544172e-08;
    other = other * qq + 2.7557319223985893e-06;
    sum = sum * qq + -0.0001984126984126984;
    other = other * qq + 0.008333333333333333;
    sum = (sum * q + other) * q + -0.16666666666666666;
    value = r + r * q * sum;
    memcpy(&parity, &shifted, sizeof parity);
    memcpy(&bits, &value, sizeof bits);
    bits ^= parity << 63;
    memcpy(&value, &bits, sizeof bits);
    return value + (fabs(u) <= 1e8 ? 0.0 : (double)NAN);
}

#endif
#if PHI_CALLS_SIN && PHI_CALLS_COS
/* sin u for vectorised loops. */
static inline double phi_sin_lane(double u) { return phi_turned_sin(u, 0.0); }

#endif
/* cos u for vectorised loops. */
static inline double phi_cos_lane(double u) { return phi_turned_sin(u, 0.5); }
#endif
