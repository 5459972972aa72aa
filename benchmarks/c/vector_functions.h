/* Sine of each lane, with an error of one or two units in the last place for arguments up to 10^5. The nearest multiple
   of pi is subtracted in three parts; a Taylor polynomial of degree 21 gives the sine of the remainder. */
INLINE lanes sine(lanes x)
{
    const lanes shift = (lanes){ 0.0 } + 0x1.8p52, shifted = x * 0x1.45f306dc9c883p-2 + shift, n = shifted - shift;
    const lanes r = ((x - n * 0x1.921fb544p1) - n * 0x1.0b4611a6p-33) - n * 0x1.3198a2e037073p-68, z = r * r;
    lanes sum = (lanes){ 0.0 } + 1.0 / 51090942171709440000.0;
    sum = sum * z - 1.0 / 121645100408832000.0;
    sum = sum * z + 1.0 / 355687428096000.0;
    sum = sum * z - 1.0 / 1307674368000.0;
    sum = sum * z + 1.0 / 6227020800.0;
    sum = sum * z - 1.0 / 39916800.0;
    sum = sum * z + 1.0 / 362880.0;
    sum = sum * z - 1.0 / 5040.0;
    sum = sum * z + 1.0 / 120.0;
    sum = sum * z - 1.0 / 6.0;
    const lanes_of_bits odd = (lanes_of_bits)shifted << 63;
    return (lanes)((lanes_of_bits)(r + r * (z * sum)) ^ odd);
}
#define sin(x) sine(x)
