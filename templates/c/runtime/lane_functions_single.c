#ifndef PHI_FILE_LANE_FUNCTIONS_SINGLE
#define PHI_FILE_LANE_FUNCTIONS_SINGLE
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if PHI_CALLS_EXP || PHI_CALLS_EXPM1 || PHI_CALLS_SIN || PHI_CALLS_COS
#define PHI_ROUNDER 12582912.0f /* 1.5 * 2^23: adding it rounds to integers */

#endif
/* Compute exp(u) - 2^k and *power = 2^k, where k is the integer nearest to u / log 2; branch-free. */
static inline float phi_exp_parts(float u, float *power)
{
    const float shifted = u * 1.442695f + PHI_ROUNDER, k = shifted - PHI_ROUNDER;
    const float r = (u - k * 0.693359375f) + k * 2.1219444e-4f, rr = r * r;
    uint32_t bits; /* the bits of `shifted`; the lowest bits are the integer k */
    float sum = 0.0013888889f, other = 1.9841270e-4f;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 127) << 23;
    memcpy(power, &bits, sizeof *power);
    sum = sum * rr + 0.041666668f;
    other = other * rr + 0.0083333334f;
    other = other * rr + 0.16666667f;
    sum = (sum * r + other) * r + 0.5f;
    sum = sum * rr + r;
    return *power * sum;
}

/* exp(u) for vectorised loops. NaN for |u| > 87. */
static inline float phi_exp_lane(float u)
{
    float power;
    const float rest = phi_exp_parts(u, &power);
    return rest + power + (fabsf(u) <= 87.0f ? 0.0f : (float)NAN);
}

/* exp(u) - 1 for vectorised loops. NaN for |u| > 87. */
static inline float phi_expm1_lane(float u)
{
    float power;
    const float rest = phi_exp_parts(u, &power);
    return rest + (power - 1.0f) + (fabsf(u) <= 87.0f ? 0.0f : (float)NAN);
}

/* log u for vectorised loops: u = 2^k m with m between sqrt 1/2 and sqrt 2; branch-free. NaN unless u is positive and
   normal. */
static inline float phi_log_lane(float u)
{
    uint32_t bits, exponent, digits;
    float m, k, sum = 0.14285715f, other = 0.11111111f;
    memcpy(&bits, &u, sizeof bits);
    exponent = (bits - 0x3f3504f3U + 0x3f800000U) >> 23; /* k + 127, the biased exponent of 2^k */
    digits = bits - ((exponent - 127) << 23);
    memcpy(&m, &digits, sizeof m);
    exponent |= 0x4b000000U; /* 2^23 + k + 127, as a float */
    memcpy(&k, &exponent, sizeof k);
    k -= 8388735.0f;
    const float f = (m - 1.0f) / (m + 1.0f), q = f * f;
    sum = (other * q + sum) * q + 0.2f;
    sum = sum * q + 0.33333334f;
    /* m - 1 is exact; the terms in low are small compared with it */
    const float low = q * sum * 2.0f * f - k * 2.1219444e-4f;
    const float rest = (m - 1.0f) - f * (m - 1.0f) + low + k * 0.693359375f;
    return rest + (u >= FLT_MIN && u <= FLT_MAX ? 0.0f : (float)NAN);
}

#if PHI_CALLS_SIN && !PHI_CALLS_COS
/* sin u for vectorised loops: u = k pi + r with |r| <= pi/2; branch-free. NaN for |u| > 8192. */
static inline float phi_sin_lane(float u)
{
    const float shifted = u * 0.31830987f + PHI_ROUNDER, k = shifted - PHI_ROUNDER;
#elif PHI_CALLS_COS
/* sin(u + offset pi) for offset 0 or 0.5: u = (k - offset) pi + r with |r| <= pi/2; branch-free. NaN for |u| > 8192. */
static inline float phi_turned_sin(float u, float offset)
{
    const float shifted = (u * 0.31830987f + offset) + PHI_ROUNDER, k = (shifted - PHI_ROUNDER) - offset;
#endif
#if PHI_CALLS_SIN || PHI_CALLS_COS
    const float reduced = (u - k * 3.140625f) - k * 9.67502594e-4f;
    const float r = (reduced - k * 1.50990672e-7f) - k * 5.1266883e-12f, q = r * r, qq = q * q;
    uint32_t parity, bits; /* bits of `shifted`; the last bit is the parity of k */
    float value, sum = -2.5052108e-8f, other = 1.6059044e-10f;
    sum = sum * qq + -1.9841270e-4f;
    other = other * qq + 2.7557319e-6f;
    other = other * qq + 0.0083333334f;
    sum = (sum * qq + -0.16666667f) + other * q;
    value = r + r * q * sum;
    memcpy(&parity, &shifted, sizeof parity);
    memcpy(&bits, &value, sizeof bits);
    bits ^= parity << 31;
    memcpy(&value, &bits, sizeof bits);
    return value + (fabsf(u) <= 8192.0f ? 0.0f : (float)NAN);
}

#endif
#if PHI_CALLS_SIN && PHI_CALLS_COS
/* sin u for vectorised loops. */
static inline float phi_sin_lane(float u) { return phi_turned_sin(u, 0.0f); }

#endif
/* cos u for vectorised loops. */
static inline float phi_cos_lane(float u) { return phi_turned_sin(u, 0.5f); }
#endif
