/* An ensemble of rigid bodies by OpenCL: cc -I generated/rigid_body opencl.c -lOpenCL -o opencl
   The text of the kernel is read from the file that the first argument names. */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <stdio.h>
#include <stdlib.h>

#include "rigid_body_device.h"

enum { MEMBERS = 1000, STEPS = 200 };

static void check(cl_int error, const char *call)
{
    if (error == CL_SUCCESS) return;
    fprintf(stderr, "%s: OpenCL error %d\n", call, (int)error);
    exit(1);
}

static char *text_of(const char *path)
{
    FILE *file = fopen(path, "rb");
    char *text = file != NULL ? calloc(1, 1 << 20) : NULL;
    if (text == NULL || fread(text, 1, (1 << 20) - 1, file) == 0) {
        fprintf(stderr, "%s cannot be read\n", path);
        exit(1);
    }
    fclose(file);
    return text;
}

int main(int count, char **arguments)
{
    static double x[rigid_body_DIM][MEMBERS];
    static unsigned char status[MEMBERS];
    const rigid_body_params params = rigid_body_default_params;
    const double h = 0.1;
    cl_platform_id platform;
    cl_device_id device;
    cl_int error;
    char *text = text_of(count > 1 ? arguments[1] : "rigid_body_device.h");
    for (int m = 0; m < MEMBERS; ++m) {
        x[0][m] = 0.01 + 1e-5 * m;
        x[1][m] = 1.0;
        x[2][m] = 0.01;
    }

    check(clGetPlatformIDs(1, &platform, NULL), "clGetPlatformIDs");
    check(clGetDeviceIDs(platform, CL_DEVICE_TYPE_DEFAULT, 1, &device, NULL), "clGetDeviceIDs");
    cl_context context = clCreateContext(NULL, 1, &device, NULL, NULL, &error);
    check(error, "clCreateContext");
    cl_command_queue queue = clCreateCommandQueue(context, device, 0, &error);
    check(error, "clCreateCommandQueue");
    cl_program program = clCreateProgramWithSource(context, 1, (const char **)&text, NULL, &error);
    check(error, "clCreateProgramWithSource");
    check(clBuildProgram(program, 1, &device, "", NULL, NULL), "clBuildProgram");
    cl_kernel kernel = clCreateKernel(program, "rigid_body_ensemble_kernel", &error);
    check(error, "clCreateKernel");

    cl_mem params_memory = clCreateBuffer(context, CL_MEM_COPY_HOST_PTR, sizeof params, (void *)&params, &error);
    check(error, "clCreateBuffer");
    cl_mem x_memory = clCreateBuffer(context, CL_MEM_COPY_HOST_PTR, sizeof x, x, &error);
    check(error, "clCreateBuffer");
    cl_mem h_memory = clCreateBuffer(context, CL_MEM_COPY_HOST_PTR, sizeof h, (void *)&h, &error);
    check(error, "clCreateBuffer");
    cl_mem status_memory = clCreateBuffer(context, CL_MEM_WRITE_ONLY, sizeof status, NULL, &error);
    check(error, "clCreateBuffer");

    /* In the order of the arguments of the kernel: params, gauge and h are for all members, there are no frames. */
    const cl_ulong members = MEMBERS, steps = STEPS, stride = 1;
    const cl_int for_all = 0;
    const struct {
        size_t size;
        const void *value;
    } passed[] = {
        { sizeof members, &members }, { sizeof(cl_mem), &params_memory }, { sizeof for_all, &for_all },
        { sizeof(cl_mem), &x_memory }, { sizeof(cl_mem), NULL }, { sizeof for_all, &for_all },
        { sizeof(cl_mem), &h_memory }, { sizeof for_all, &for_all }, { sizeof steps, &steps },
        { sizeof stride, &stride }, { sizeof(cl_mem), NULL }, { sizeof(cl_mem), &status_memory },
    };
    for (cl_uint k = 0; k < sizeof passed / sizeof passed[0]; ++k)
        check(clSetKernelArg(kernel, k, passed[k].size, passed[k].value), "clSetKernelArg");

    const size_t group = rigid_body_GROUP, items = (MEMBERS + group - 1) / group * group;
    check(clEnqueueNDRangeKernel(queue, kernel, 1, NULL, &items, &group, 0, NULL, NULL), "clEnqueueNDRangeKernel");
    check(clEnqueueReadBuffer(queue, x_memory, CL_TRUE, 0, sizeof x, x, 0, NULL, NULL), "clEnqueueReadBuffer");
    check(clEnqueueReadBuffer(queue, status_memory, CL_TRUE, 0, sizeof status, status, 0, NULL, NULL),
        "clEnqueueReadBuffer");
    for (int m = 0; m < MEMBERS; m += 333)
        printf("%4d: status %d, %.15g %.15g %.15g\n", m, status[m], x[0][m], x[1][m], x[2][m]);
    free(text);
    return 0;
}
