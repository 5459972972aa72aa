/* Declarations of MATLAB's mex.h that the gateways use, so that a compiler can check their types without MATLAB. */
#include <stddef.h>
typedef struct mxArray mxArray;
typedef enum { mxREAL, mxCOMPLEX } mxComplexity;
int mxIsDouble(const mxArray *a);
int mxIsComplex(const mxArray *a);
int mxIsStruct(const mxArray *a);
size_t mxGetNumberOfElements(const mxArray *a);
double mxGetScalar(const mxArray *a);
double *mxGetPr(const mxArray *a);
int mxGetNumberOfFields(const mxArray *a);
const char *mxGetFieldNameByNumber(const mxArray *a, int number);
mxArray *mxGetFieldByNumber(const mxArray *a, size_t index, int number);
void mxDestroyArray(mxArray *a);
mxArray *mxCreateDoubleMatrix(size_t rows, size_t columns, mxComplexity complexity);
void mexErrMsgIdAndTxt(const char *id, const char *format, ...);
void mexFunction(int out_count, mxArray *out[], int in_count, const mxArray *in[]);
