/* rt_gpu.h - rt.h on OpenCL 1.2 devices.    SPDX-License-Identifier: MIT OR Unlicense

   The same traversals and primitive tests, hits and pictures, bit for bit, on a GPU, or on a CPU through PoCL. Kernels are in the program, and
   are compiled for the scene; OpenCL is opened at run time, so nothing is linked, and a program that never calls rt_gpu_open runs where there
   is none.

   QUICK START

       #define RT_IMPLEMENTATION
       #include "rt.h"
       #define RT_GPU_IMPLEMENTATION        // in the file that has RT_IMPLEMENTATION
       #include "rt_gpu.h"

       rt_gpu *gpu;
       rt_gpu_accel *there;
       if (rt_gpu_open(&gpu, NULL) != RT_OK) return 1;              // the first GPU, else the first CPU
       if (rt_gpu_upload(gpu, &there, accel, NULL) != RT_OK) return 1;
       rt_gpu_trace(gpu, there, NULL, rays, count, hits);           // as rt_trace
       rt_gpu_close(gpu);

     And a picture: rt_gpu_upload_scene, then rt_gpu_render_tile, as rt_render_tile.

   CONTENTS (search for the tag)

       declarations    >>gpu-device  >>gpu-accel  >>gpu-trace  >>gpu-buffers  >>gpu-scene
       implementation  >>gpu-opencl  >>gpu-open   >>gpu-upload >>gpu-text    >>gpu-program  >>gpu-run  >>gpu-render

   LIFETIME AND THREADS

     What a context, an rt_gpu, makes belongs to it: rt_gpu_close frees what is left, and waits for what still runs. A context and all that it
     made is for one thread at a time; contexts do not know of each other. An accel may be freed once it is uploaded. The library keeps
     no global state and prints nothing; OpenCL itself, once opened, stays.

   MACROS, each defined before the include

       RT_GPU_IMPLEMENTATION    emit the code here, behind rt.h's, and under the same RT_NO_*
       RT_GPU_KERNELS           the name rt_gpu_kernels.cl is included by; default "rt_gpu_kernels.cl". rt.h is, by RT_SELF

   ENVIRONMENT

       RT_GPU_DEVICE    what rt_gpu_options.device is where it is NULL
       RT_GPU_LIBRARY   the library to open, instead of the system's OpenCL  */

#ifndef RT_GPU_H
#define RT_GPU_H

#ifndef RT_H
#error "rt_gpu.h: include rt.h first"
#endif

/* ---- >>gpu-device --------------------------------------------------------------------------------------------------- */

/* A device of the machine. */
typedef struct {
    char name[128], platform[128], version[64];
    bool gpu;                               /* else a CPU, or an accelerator */
    bool usable;                            /* false: lacks tells why */
    bool exact;                             /* float division is correctly rounded: hits are those of the CPU, bit for bit */
    char lacks[64];
    uint32_t units;                         /* compute units */
    uint64_t memory, largest;               /* bytes: of the device, and of one buffer at most */
} rt_gpu_info;

/* Writes up to max of the machine's devices to infos, and to *count how many there are: the number of a device is its place there.
   RT_ERROR_NO_DEVICE: there is no OpenCL. error may be NULL. */
RT_API rt_status rt_gpu_list(rt_gpu_info *infos, size_t max, size_t *count, rt_error *error);

typedef struct rt_gpu rt_gpu;               /* a context: a device, its programs and buffers */

/* Zero is the default of every field. */
typedef struct {
    const char *device;                     /* "gpu", "cpu", a number of rt_gpu_list, or part of a name; NULL: the environment's
                                               RT_GPU_DEVICE, or else the first GPU that is usable, or else the first device that is */
    size_t memory_limit;                    /* bytes that all buffers may take together; 0: what the device has */
    bool inexact;                           /* a device that is not exact will do too: t, u and v may differ in their last bits */
    bool general;                           /* compile programs for any scene, not for the one at hand: fewer and slower */
    const char *flags;                      /* more of them for OpenCL's compiler */
    void *memory_user;                      /* given to RT_MALLOC and RT_FREE */
    rt_error *error;                        /* NULL: only the status tells */
} rt_gpu_options;

/* Opens a device; opt NULL = defaults. RT_ERROR_NO_DEVICE: no OpenCL, no such device; RT_ERROR_UNSUPPORTED: it lacks something (double
   precision, denormals; correctly rounded division, unless opt->inexact), which the message names. *out is NULL then. */
RT_API rt_status rt_gpu_open(rt_gpu **out, const rt_gpu_options *opt);

/* Waits for what still runs and frees the context with all that it made; NULL is fine. */
RT_API void rt_gpu_close(rt_gpu *gpu);

RT_API void rt_gpu_get_info(const rt_gpu *gpu, rt_gpu_info *info);

/* What OpenCL's compiler said of the last program that it refused; "" before that. Owned by gpu, until the next call with it. */
RT_API const char *rt_gpu_log(const rt_gpu *gpu);

/* How many programs gpu has compiled. */
RT_API size_t rt_gpu_program_count(const rt_gpu *gpu);

/* ---- >>gpu-accel ---------------------------------------------------------------------------------------------------- */

typedef struct rt_gpu_accel rt_gpu_accel;   /* an rt_accel, and all that it instances, on a device */

/* Copies accel to the device, in O(its bytes). Changes of accel are not seen: upload it again. RT_ERROR_MEMORY: it does not fit there;
   RT_ERROR_ARGUMENT: built with no_binary. error may be NULL. */
RT_API rt_status rt_gpu_upload(rt_gpu *gpu, rt_gpu_accel **out, const rt_accel *accel, rt_error *error);

RT_API void rt_gpu_free(rt_gpu_accel *accel);

/* Bytes that it takes on the device. */
RT_API size_t rt_gpu_bytes(const rt_gpu_accel *accel);

/* ---- >>gpu-trace ---------------------------------------------------------------------------------------------------- */

/* As rt_trace, and with its hits. Of opt, stats must be NULL, isa is not looked at, and algorithms have these packet_widths (0: the default):
     RT_KD_STACK, RT_KD_RESTART, RT_KD_PUSHDOWN, RT_KD_SHORTSTACK, RT_BVH_SIMD   1: a ray a work-item; 2, 8, 16: packets of 2x2, 8, 16
     RT_KD_BACKTRACK, RT_BVH_STACK, RT_BVH_WIDE, RT_THREADED_SINGLE              1
     RT_THREADED_PARALLEL                                2, 4, 8, 16 rays
     RT_BVH_MASKED, RT_BVH_RANGED, RT_BVH_PARTITION      4, 8, 16, 32: packets of 4x4 to 32x32, culled as opt->cull says
   A large packet is a work-group. Its work-items have a ray each, or eight on a CPU, and go through instances each by itself. It takes local
   memory, up to 45 KB on a GPU (RT_BVH_PARTITION, 32x32) and 48 KB on a CPU; RT_ERROR_UNSUPPORTED: the device has less.
   RT_AUTO takes what measures fastest on the kind of device. A program is compiled where none fits yet, which takes seconds.
   Copies rays to the device and hits back, a million at a time. */
RT_API rt_status rt_gpu_trace(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, const rt_ray *rays, size_t count,
                              rt_hit *hits);

/* Compiles what rt_gpu_trace would need for that, unless it has been: seconds that the first call does not take then. The device's own
   code may still be made when it first runs. */
RT_API rt_status rt_gpu_prepare(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt);

/* The packet widths of an algorithm there, as rt_packet_widths; none: no kernel has it. */
RT_API size_t rt_gpu_widths(rt_algorithm algorithm, int *widths, size_t max);

/* A kernel, as far as the driver tells; 0: it does not. */
typedef struct {
    rt_algorithm algorithm;                 /* what RT_AUTO stands for */
    int packet_width;                       /* what 0 stands for */
    size_t private_bytes, local_bytes;      /* memory of a work-item, which may be beside its registers, and of a work-group */
    size_t group;                           /* work-items of a work-group at most */
} rt_gpu_kernel;

/* What rt_gpu_trace would run for that; compiled, unless it has been. */
RT_API rt_status rt_gpu_get_kernel(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, rt_gpu_kernel *kernel);

/* ---- >>gpu-buffers -------------------------------------------------------------------------------------------------- */

typedef struct rt_gpu_buffer rt_gpu_buffer;         /* memory of a device */
typedef struct rt_gpu_event rt_gpu_event;           /* something that it was told to do */

/* size bytes, above 0, not initialised. */
RT_API rt_status rt_gpu_buffer_new(rt_gpu *gpu, rt_gpu_buffer **out, size_t size, rt_error *error);
RT_API void rt_gpu_buffer_free(rt_gpu_buffer *buffer);

/* Copies size bytes at an offset of buffer, and returns when they are copied: after all that gpu was told before. */
RT_API rt_status rt_gpu_write(rt_gpu_buffer *buffer, size_t offset, const void *from, size_t size, rt_error *error);
RT_API rt_status rt_gpu_read(rt_gpu_buffer *buffer, size_t offset, void *to, size_t size, rt_error *error);

/* As rt_gpu_trace, from count rt_ray in one buffer to rt_hit in another, and without waiting: the device does what it is told in order.
   times: floats, or NULL; opt->times must be NULL. event, unless NULL, is for rt_gpu_wait. */
RT_API rt_status rt_gpu_trace_buffers(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, const rt_gpu_buffer *rays,
                                      const rt_gpu_buffer *times, size_t count, rt_gpu_buffer *hits, rt_gpu_event **event);

/* Waits until it is done and frees it; seconds, unless NULL: that the device was at it. */
RT_API rt_status rt_gpu_wait(rt_gpu_event *event, double *seconds, rt_error *error);

/* Is it done? */
RT_API bool rt_gpu_done(const rt_gpu_event *event);

/* Waits for all that gpu was told. */
RT_API rt_status rt_gpu_finish(rt_gpu *gpu, rt_error *error);

/* ---- >>gpu-scene ---------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

typedef struct rt_gpu_scene rt_gpu_scene;   /* an rt_scene with its accel, and all parts, on a device */

/* Copies scene, of which rt_check_scene must hold, as of every part, with its accel, geometry, materials, textures, lights and parts, each
   array once, in O(its bytes). Changes are not seen, but for the camera's, which rt_gpu_set_camera makes. RT_ERROR_ARGUMENT: an accel, a
   geometry or a part is missing; RT_ERROR_MEMORY: it does not fit; RT_ERROR_LIMIT: it takes more than 64 GB. error may be NULL. */
RT_API rt_status rt_gpu_upload_scene(rt_gpu *gpu, rt_gpu_scene **out, const rt_scene *scene, rt_error *error);
RT_API void rt_gpu_free_scene(rt_gpu_scene *scene);
RT_API void rt_gpu_set_camera(rt_gpu_scene *scene, const rt_camera *camera);

/* Bytes that it takes on the device. */
RT_API size_t rt_gpu_scene_bytes(const rt_gpu_scene *scene);

/* As rt_render_tile, and the same picture, bit for bit. Rays are traced by any algorithm that rt_gpu_trace has, all of a sample's at once: so
   large tiles are the fastest, the whole picture at best; it is cut up to fit the device, and what it takes there, up to 512 MB, is kept for
   the next. Of opt, trace is as for rt_gpu_trace: stats must be NULL; raster is copied by each call. A tile without pixels compiles what others
   like it need, and no more. If the device fails on the way, pixels holds some of the picture, and counts have not been added to rays. */
RT_API rt_status rt_gpu_render_tile(rt_gpu *gpu, const rt_gpu_scene *scene, const rt_render_options *opt, int x0, int y0, int x1, int y1,
                                    rt_vec3 *pixels, rt_ray_counts *rays);

#endif

#endif /* RT_GPU_H */

/* ==== implementation ================================================================================================ */

#if defined(RT_GPU_IMPLEMENTATION) && !defined(RTI_GPU_IMPLEMENTED)
#define RTI_GPU_IMPLEMENTED

#ifndef RTI_IMPLEMENTED
#error "rt_gpu.h: RT_GPU_IMPLEMENTATION goes into the file that has RT_IMPLEMENTATION, behind its #include of rt.h"
#endif
#ifndef RT_GPU_KERNELS
#define RT_GPU_KERNELS "rt_gpu_kernels.cl"
#endif

#include <stdlib.h>
#ifndef _WIN32
#include <dlfcn.h>
#endif

/* ---- >>gpu-opencl --------------------------------------------------------------------------------------------------- */

/* The little of OpenCL 1.2 that is used, under names of our own: CL/cl.h may be included beside it. */
typedef int32_t rti_cl_int;
typedef uint32_t rti_cl_uint;
typedef uint64_t rti_cl_ulong;
typedef void *rti_cl;                       /* a platform, device, context, queue, program, kernel, buffer or event */

enum {
    RTI_CL_SUCCESS = 0, RTI_CL_DEVICE_NOT_FOUND = -1, RTI_CL_COMPILER_NOT_AVAILABLE = -3, RTI_CL_NO_MEMORY = -4, RTI_CL_NO_RESOURCES = -5,
    RTI_CL_NO_HOST_MEMORY = -6, RTI_CL_BUILD_FAILURE = -11, RTI_CL_BAD_SIZE = -61,
    RTI_CL_PLATFORM_NAME = 0x0902,
    RTI_CL_TYPE_CPU = 2, RTI_CL_TYPE_GPU = 4,
    RTI_CL_DEVICE_TYPE = 0x1000, RTI_CL_DEVICE_UNITS = 0x1002, RTI_CL_DEVICE_MAX_GROUP = 0x1004, RTI_CL_DEVICE_LARGEST = 0x1010,
    RTI_CL_DEVICE_SINGLE = 0x101B, RTI_CL_DEVICE_MEMORY = 0x101F, RTI_CL_DEVICE_LOCAL = 0x1023, RTI_CL_DEVICE_LITTLE = 0x1026,
    RTI_CL_DEVICE_AVAILABLE = 0x1027, RTI_CL_DEVICE_COMPILER = 0x1028, RTI_CL_DEVICE_NAME = 0x102B, RTI_CL_DEVICE_VERSION = 0x102F,
    RTI_CL_DEVICE_DOUBLE = 0x1032,
    RTI_CL_DENORM = 1, RTI_CL_ROUNDED_DIVIDE = 128,
    RTI_CL_QUEUE_PROFILING = 2,
    RTI_CL_READ_WRITE = 1, RTI_CL_READ_ONLY = 4,
    RTI_CL_BUILD_LOG = 0x1183,
    RTI_CL_GROUP_SIZE = 0x11B0, RTI_CL_LOCAL_SIZE = 0x11B2, RTI_CL_PRIVATE_SIZE = 0x11B4,
    RTI_CL_EVENT_STATUS = 0x11D3,
    RTI_CL_PROFILE_START = 0x1282, RTI_CL_PROFILE_END = 0x1283
};

#if defined(_WIN32)
#define RTI_CL_CALL __stdcall
#else
#define RTI_CL_CALL
#endif
#define RTI_CL_LIST(X)                                                                                                                \
    X(GetPlatformIDs, rti_cl_int, (rti_cl_uint, rti_cl *, rti_cl_uint *))                                                             \
    X(GetPlatformInfo, rti_cl_int, (rti_cl, rti_cl_uint, size_t, void *, size_t *))                                                   \
    X(GetDeviceIDs, rti_cl_int, (rti_cl, rti_cl_ulong, rti_cl_uint, rti_cl *, rti_cl_uint *))                                         \
    X(GetDeviceInfo, rti_cl_int, (rti_cl, rti_cl_uint, size_t, void *, size_t *))                                                     \
    X(CreateContext, rti_cl, (const intptr_t *, rti_cl_uint, const rti_cl *, void *, void *, rti_cl_int *))                           \
    X(ReleaseContext, rti_cl_int, (rti_cl))                                                                                           \
    X(CreateCommandQueue, rti_cl, (rti_cl, rti_cl, rti_cl_ulong, rti_cl_int *))                                                       \
    X(ReleaseCommandQueue, rti_cl_int, (rti_cl))                                                                                      \
    X(CreateBuffer, rti_cl, (rti_cl, rti_cl_ulong, size_t, void *, rti_cl_int *))                                                     \
    X(ReleaseMemObject, rti_cl_int, (rti_cl))                                                                                         \
    X(CreateProgramWithSource, rti_cl, (rti_cl, rti_cl_uint, const char **, const size_t *, rti_cl_int *))                            \
    X(BuildProgram, rti_cl_int, (rti_cl, rti_cl_uint, const rti_cl *, const char *, void *, void *))                                  \
    X(GetProgramBuildInfo, rti_cl_int, (rti_cl, rti_cl, rti_cl_uint, size_t, void *, size_t *))                                       \
    X(ReleaseProgram, rti_cl_int, (rti_cl))                                                                                           \
    X(CreateKernel, rti_cl, (rti_cl, const char *, rti_cl_int *))                                                                     \
    X(GetKernelWorkGroupInfo, rti_cl_int, (rti_cl, rti_cl, rti_cl_uint, size_t, void *, size_t *))                                    \
    X(ReleaseKernel, rti_cl_int, (rti_cl))                                                                                            \
    X(SetKernelArg, rti_cl_int, (rti_cl, rti_cl_uint, size_t, const void *))                                                          \
    X(EnqueueNDRangeKernel, rti_cl_int, (rti_cl, rti_cl, rti_cl_uint, const size_t *, const size_t *, const size_t *, rti_cl_uint,    \
                                         const rti_cl *, rti_cl *))                                                                   \
    X(EnqueueWriteBuffer, rti_cl_int, (rti_cl, rti_cl, rti_cl_uint, size_t, size_t, const void *, rti_cl_uint, const rti_cl *, rti_cl *)) \
    X(EnqueueReadBuffer, rti_cl_int, (rti_cl, rti_cl, rti_cl_uint, size_t, size_t, void *, rti_cl_uint, const rti_cl *, rti_cl *))    \
    X(Flush, rti_cl_int, (rti_cl))                                                                                                    \
    X(Finish, rti_cl_int, (rti_cl))                                                                                                   \
    X(WaitForEvents, rti_cl_int, (rti_cl_uint, const rti_cl *))                                                                       \
    X(GetEventInfo, rti_cl_int, (rti_cl, rti_cl_uint, size_t, void *, size_t *))                                                      \
    X(GetEventProfilingInfo, rti_cl_int, (rti_cl, rti_cl_uint, size_t, void *, size_t *))                                             \
    X(ReleaseEvent, rti_cl_int, (rti_cl))

#define RTI_CL_MEMBER(name, result, arguments) result (RTI_CL_CALL *name) arguments;
typedef struct { RTI_CL_LIST(RTI_CL_MEMBER) } rti_cl_api;

#if defined(_WIN32)
#ifdef __cplusplus
extern "C" {
#endif
__declspec(dllimport) void *__stdcall LoadLibraryA(const char *name);
__declspec(dllimport) void *__stdcall GetProcAddress(void *library, const char *name);
#ifdef __cplusplus
}
#endif
#endif

/* The system's OpenCL, which stays opened: devices of drivers that are closed crash. */
static rt_status rti_cl_load(rti_cl_api *cl, rt_error *error)
{
#if defined(_WIN32)
    static const char *const names[] = { "OpenCL.dll" };
#elif defined(__APPLE__)
    static const char *const names[] = { "/System/Library/Frameworks/OpenCL.framework/OpenCL" };
#else
    static const char *const names[] = { "libOpenCL.so.1", "libOpenCL.so" };
#endif
    const char *const asked = getenv("RT_GPU_LIBRARY");
    void *library = NULL, *found;
    size_t i;
    for (i = 0; i < (asked ? 1 : sizeof names / sizeof names[0]) && !library; i++) {
#if defined(_WIN32)
        library = LoadLibraryA(asked ? asked : names[i]);
#else
        library = dlopen(asked ? asked : names[i], RTLD_NOW | RTLD_LOCAL);
#endif
    }
    if (!library)
        return rti_fail(error, RT_ERROR_NO_DEVICE, RT_NONE, "OpenCL is not installed: %s cannot be opened", asked ? asked : names[0]);
#if defined(_WIN32)
#define RTI_CL_FIND(text) GetProcAddress(library, text)
#else
#define RTI_CL_FIND(text) dlsym(library, text)
#endif
#define RTI_CL_TAKE(name, result, arguments)                                                                                      \
    found = RTI_CL_FIND("cl" #name);                                                                                              \
    if (!found)                                                                                                                   \
        return rti_fail(error, RT_ERROR_NO_DEVICE, RT_NONE, "%s lacks cl" #name, asked ? asked : "the OpenCL that is installed"); \
    memcpy(&cl->name, &found, sizeof found);
    RTI_CL_LIST(RTI_CL_TAKE)
    return RT_OK;
}

static rt_status rti_cl_status(rti_cl_int code)
{
    switch (code) {
    case RTI_CL_SUCCESS: return RT_OK;
    case RTI_CL_NO_MEMORY: case RTI_CL_NO_RESOURCES: case RTI_CL_NO_HOST_MEMORY: case RTI_CL_BAD_SIZE: return RT_ERROR_MEMORY;
    case RTI_CL_BUILD_FAILURE: case RTI_CL_COMPILER_NOT_AVAILABLE: return RT_ERROR_UNSUPPORTED;
    default: return RT_ERROR_NO_DEVICE;
    }
}

static rt_status rti_cl_fail(rt_error *error, rti_cl_int code, const char *what)
{
    const rt_status status = rti_cl_status(code);
    return rti_fail(error, status, RT_NONE, "%s: %s (OpenCL error %d)", what,
                    status == RT_ERROR_MEMORY ? "the device is out of memory" : "the device or its driver fails", (int)code);
}

/* ---- >>gpu-open ----------------------------------------------------------------------------------------------------- */

typedef struct rti_gpu_program rti_gpu_program;
typedef struct rti_gpu_object rti_gpu_object;

/* What a context made heads a list: closing it frees them. */
struct rti_gpu_object {
    rt_gpu *gpu;
    rti_gpu_object *next, **link;           /* link: what points here */
    rti_cl mem;                             /* of an event: itself */
    size_t bytes;
    bool event;
};

struct rt_gpu {
    rti_cl_api cl;
    rti_cl device, context, queue;
    rt_gpu_info info;
    size_t group, local;                    /* most work-items of a group, and bytes of its memory */
    size_t memory_limit, used;              /* bytes that may be and are taken */
    bool general;
    char *flags, *log;
    rti_gpu_program *programs;
    size_t program_count;
    rti_gpu_object *objects;
    rt_gpu_buffer *rays, *hits, *times;     /* of rt_gpu_trace; then of a tile, with: */
    rt_gpu_buffer *work;
    void *memory_user;
};
struct rt_gpu_buffer { rti_gpu_object object; };
struct rt_gpu_event { rti_gpu_object object; };

#define RTI_GPU_PLATFORMS 16
#define RTI_GPU_DEVICES 64

static void rti_gpu_text(const rti_cl_api *cl, rti_cl of, bool platform, rti_cl_uint what, char *text, size_t size)
{
    char whole[1024];
    size_t length = 0;
    const rti_cl_int code = platform ? cl->GetPlatformInfo(of, what, sizeof whole, whole, &length)
                                     : cl->GetDeviceInfo(of, what, sizeof whole, whole, &length);
    if (code != RTI_CL_SUCCESS || !length) length = 1;
    whole[length < sizeof whole ? length : sizeof whole - 1] = 0;
    if (length == 1) whole[0] = 0;
    snprintf(text, size, "%.*s", (int)size - 1, whole);
}

static uint64_t rti_gpu_number(const rti_cl_api *cl, rti_cl device, rti_cl_uint what)
{
    union { uint64_t wide; uint32_t narrow; } number;
    size_t size = 0;
    number.wide = 0;
    if (cl->GetDeviceInfo(device, what, sizeof number, &number, &size) != RTI_CL_SUCCESS) return 0;
    return size == 4 ? number.narrow : number.wide;
}

/* Hits can only be the same where arithmetic is. */
static void rti_gpu_describe(const rti_cl_api *cl, rti_cl platform, rti_cl device, rt_gpu_info *info)
{
    const uint64_t single = rti_gpu_number(cl, device, RTI_CL_DEVICE_SINGLE);
    const char *lacks = NULL;
    memset(info, 0, sizeof *info);
    rti_gpu_text(cl, platform, true, RTI_CL_PLATFORM_NAME, info->platform, sizeof info->platform);
    rti_gpu_text(cl, device, false, RTI_CL_DEVICE_NAME, info->name, sizeof info->name);
    rti_gpu_text(cl, device, false, RTI_CL_DEVICE_VERSION, info->version, sizeof info->version);
    info->gpu = (rti_gpu_number(cl, device, RTI_CL_DEVICE_TYPE) & RTI_CL_TYPE_GPU) != 0;
    info->units = (uint32_t)rti_gpu_number(cl, device, RTI_CL_DEVICE_UNITS);
    info->memory = rti_gpu_number(cl, device, RTI_CL_DEVICE_MEMORY);
    info->largest = rti_gpu_number(cl, device, RTI_CL_DEVICE_LARGEST);
    if (!rti_gpu_number(cl, device, RTI_CL_DEVICE_AVAILABLE)) lacks = "is not available";
    else if (!rti_gpu_number(cl, device, RTI_CL_DEVICE_COMPILER)) lacks = "has no compiler";
    else if (!rti_gpu_number(cl, device, RTI_CL_DEVICE_LITTLE)) lacks = "is big-endian";
    else if (!rti_gpu_number(cl, device, RTI_CL_DEVICE_DOUBLE)) lacks = "has no double precision";
    else if (!(single & RTI_CL_DENORM)) lacks = "has no denormal floats";
    info->exact = (single & RTI_CL_ROUNDED_DIVIDE) != 0;
    info->usable = !lacks;
    if (lacks) snprintf(info->lacks, sizeof info->lacks, "%s", lacks);
}

/* All devices of all platforms. */
static rt_status rti_gpu_find(const rti_cl_api *cl, rti_cl devices[RTI_GPU_DEVICES], rti_cl platforms[RTI_GPU_DEVICES], size_t *count,
                              rt_error *error)
{
    rti_cl all[RTI_GPU_PLATFORMS];
    rti_cl_uint found = 0, i, j, n;
    *count = 0;
    if (cl->GetPlatformIDs(RTI_GPU_PLATFORMS, all, &found) != RTI_CL_SUCCESS || !found)
        return rti_fail(error, RT_ERROR_NO_DEVICE, RT_NONE, "OpenCL is there but no driver for a device (PoCL is one for any CPU)");
    for (i = 0; i < found && i < RTI_GPU_PLATFORMS; i++) {
        n = 0;
        if (cl->GetDeviceIDs(all[i], 0xffffffffu, (rti_cl_uint)(RTI_GPU_DEVICES - *count), devices + *count, &n) != RTI_CL_SUCCESS) continue;
        for (j = 0; j < n && *count < RTI_GPU_DEVICES; j++) platforms[(*count)++] = all[i];
    }
    if (!*count) return rti_fail(error, RT_ERROR_NO_DEVICE, RT_NONE, "OpenCL is there but no device");
    return RT_OK;
}

RT_API rt_status rt_gpu_list(rt_gpu_info *infos, size_t max, size_t *count, rt_error *error)
{
    rti_cl devices[RTI_GPU_DEVICES], platforms[RTI_GPU_DEVICES];
    rti_cl_api cl;
    rt_status status;
    size_t i;
    if (!count || (max && !infos)) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", count ? "infos" : "count");
    *count = 0;
    if ((status = rti_cl_load(&cl, error)) != RT_OK || (status = rti_gpu_find(&cl, devices, platforms, count, error)) != RT_OK) return status;
    for (i = 0; i < *count && i < max; i++) rti_gpu_describe(&cl, platforms[i], devices[i], &infos[i]);
    return RT_OK;
}

static bool rti_gpu_same(char a, char b) { return (a >= 'A' && a <= 'Z' ? a + 32 : a) == (b >= 'A' && b <= 'Z' ? b + 32 : b); }

/* Does the text have that part, in any case of letters? */
static bool rti_gpu_has(const char *text, const char *part)
{
    for (;; text++) {
        size_t i = 0;
        while (part[i] && rti_gpu_same(text[i], part[i])) i++;
        if (!part[i]) return true;
        if (!*text) return false;
    }
}

/* The device that is asked for, see rt_gpu_options. */
static rt_status rti_gpu_choose(const rti_cl_api *cl, const char *asked, bool inexact, rti_cl *device, rt_gpu_info *info, rt_error *error)
{
    rti_cl devices[RTI_GPU_DEVICES], platforms[RTI_GPU_DEVICES];
    const bool any = !asked || !*asked, number = !any && strspn(asked, "0123456789") == strlen(asked);
    const bool gpu = !any && !strcmp(asked, "gpu"), cpu = !any && !strcmp(asked, "cpu");
    rt_gpu_info one, best;
    size_t count, i;
    int best_rank = 0;
    rt_status status = rti_gpu_find(cl, devices, platforms, &count, error);
    if (status != RT_OK) return status;
    memset(&best, 0, sizeof best);
    for (i = 0; i < count; i++) {
        int rank = 0;
        rti_gpu_describe(cl, platforms[i], devices[i], &one);
        if (one.usable && !one.exact && !inexact) {
            one.usable = false;
            snprintf(one.lacks, sizeof one.lacks, "has no correctly rounded division");
        }
        if (any) rank = one.usable ? one.gpu ? 3 : 2 : 1;
        else if (number ? strtoul(asked, NULL, 10) == i : gpu ? one.gpu : cpu ? !one.gpu : rti_gpu_has(one.name, asked) || rti_gpu_has(one.platform, asked))
            rank = one.usable ? 2 : 1;
        if (rank > best_rank) {
            best_rank = rank;
            best = one;
            *device = devices[i];
        }
    }
    if (!best_rank)
        return rti_fail(error, RT_ERROR_NO_DEVICE, RT_NONE, "no device is called %s; there are %u, the first is %s", asked, (unsigned)count, one.name);
    if (!best.usable) return rti_fail(error, RT_ERROR_UNSUPPORTED, RT_NONE, "device %s %s", best.name, best.lacks);
    *info = best;
    return RT_OK;
}

static char *rti_gpu_copy_text(const char *text, void *user)
{
    const size_t size = strlen(text) + 1;
    char *copy = (char *)rti_alloc(size, 1, user);
    if (copy) memcpy(copy, text, size);
    return copy;
}

RT_API rt_status rt_gpu_open(rt_gpu **out, const rt_gpu_options *opt)
{
    rt_gpu_options defaults;
    rti_cl_int code = RTI_CL_SUCCESS;
    rt_status status;
    rt_gpu *gpu;
    memset(&defaults, 0, sizeof defaults);
    if (!opt) opt = &defaults;
    if (!out) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "out is NULL");
    *out = NULL;
    gpu = (rt_gpu *)rti_alloc(1, sizeof *gpu, opt->memory_user);
    if (!gpu) return rti_fail(opt->error, RT_ERROR_MEMORY, RT_NONE, "no memory for a context");
    memset(gpu, 0, sizeof *gpu);
    gpu->memory_user = opt->memory_user;
    gpu->general = opt->general;
    status = rti_cl_load(&gpu->cl, opt->error);
    if (status == RT_OK)
        status = rti_gpu_choose(&gpu->cl, opt->device ? opt->device : getenv("RT_GPU_DEVICE"), opt->inexact, &gpu->device, &gpu->info, opt->error);
    if (status == RT_OK) {
        gpu->memory_limit = opt->memory_limit;
        if (!gpu->memory_limit || gpu->memory_limit > gpu->info.memory) gpu->memory_limit = (size_t)gpu->info.memory;
        gpu->group = (size_t)rti_gpu_number(&gpu->cl, gpu->device, RTI_CL_DEVICE_MAX_GROUP);
        gpu->local = (size_t)rti_gpu_number(&gpu->cl, gpu->device, RTI_CL_DEVICE_LOCAL);
        gpu->flags = rti_gpu_copy_text(opt->flags ? opt->flags : "", gpu->memory_user);
        if (!gpu->flags) status = rti_fail(opt->error, RT_ERROR_MEMORY, RT_NONE, "no memory for a context");
    }
    if (status == RT_OK) {
        gpu->context = gpu->cl.CreateContext(NULL, 1, &gpu->device, NULL, NULL, &code);
        if (gpu->context) gpu->queue = gpu->cl.CreateCommandQueue(gpu->context, gpu->device, RTI_CL_QUEUE_PROFILING, &code);
        if (!gpu->queue) status = rti_cl_fail(opt->error, code, "a context");
    }
    if (status == RT_OK) *out = gpu;
    else rt_gpu_close(gpu);
    return status;
}

/* Releases an object of a context; its memory goes back to RT_FREE. */
static void rti_gpu_drop(rti_gpu_object *object)
{
    rt_gpu *gpu = object->gpu;
    *object->link = object->next;
    if (object->next) object->next->link = object->link;
    if (object->event) gpu->cl.ReleaseEvent(object->mem);
    else if (object->mem) gpu->cl.ReleaseMemObject(object->mem);
    gpu->used -= object->bytes;
    rti_release(object, gpu->memory_user);
}

static void rti_gpu_free_programs(rt_gpu *gpu);

RT_API void rt_gpu_close(rt_gpu *gpu)
{
    if (!gpu) return;
    if (gpu->queue) gpu->cl.Finish(gpu->queue);
    while (gpu->objects) rti_gpu_drop(gpu->objects);
    rti_gpu_free_programs(gpu);
    if (gpu->queue) gpu->cl.ReleaseCommandQueue(gpu->queue);
    if (gpu->context) gpu->cl.ReleaseContext(gpu->context);
    rti_release(gpu->flags, gpu->memory_user);
    rti_release(gpu->log, gpu->memory_user);
    rti_release(gpu, gpu->memory_user);
}

RT_API void rt_gpu_get_info(const rt_gpu *gpu, rt_gpu_info *info) { *info = gpu->info; }
RT_API const char *rt_gpu_log(const rt_gpu *gpu) { return gpu->log ? gpu->log : ""; }

RT_API size_t rt_gpu_program_count(const rt_gpu *gpu) { return gpu->program_count; }

/* size bytes of the host for an object, which takes bytes of the device. */
static rt_status rti_gpu_make(rt_gpu *gpu, size_t size, size_t bytes, rti_cl_ulong kind, rti_gpu_object **out, const char *what, rt_error *error)
{
    rti_gpu_object *object;
    rti_cl_int code = RTI_CL_SUCCESS;
    *out = NULL;
    if (bytes > gpu->info.largest || bytes > gpu->memory_limit - gpu->used)
        return rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "%s of %.1f MB: the device has %.1f MB left, at most %.1f MB in one piece", what, 1e-6 * (double)bytes,
                        1e-6 * (double)(gpu->memory_limit - gpu->used), 1e-6 * (double)gpu->info.largest);
    object = (rti_gpu_object *)rti_alloc(1, size, gpu->memory_user);
    if (!object) return rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "no memory for %s", what);
    memset(object, 0, size);
    if (bytes) {
        object->mem = gpu->cl.CreateBuffer(gpu->context, kind, bytes, NULL, &code);
        if (!object->mem || code != RTI_CL_SUCCESS) {
            rti_release(object, gpu->memory_user);
            return rti_cl_fail(error, code, what);
        }
    }
    object->gpu = gpu;
    object->bytes = bytes;
    object->next = gpu->objects;
    object->link = &gpu->objects;
    if (object->next) object->next->link = &object->next;
    gpu->objects = object;
    gpu->used += bytes;
    *out = object;
    return RT_OK;
}

/* Returns when it is copied. */
static rt_status rti_gpu_send(const rti_gpu_object *to, size_t at, const void *from, size_t bytes, const char *what, rt_error *error)
{
    const rti_cl_int code = to->gpu->cl.EnqueueWriteBuffer(to->gpu->queue, to->mem, 1, at, bytes, from, 0, NULL, NULL);
    return code == RTI_CL_SUCCESS ? RT_OK : rti_cl_fail(error, code, what);
}

static rt_status rti_gpu_make_buffer(rt_gpu *gpu, rt_gpu_buffer **out, size_t size, rt_error *error)
{
    rti_gpu_object *object;
    const rt_status status = rti_gpu_make(gpu, sizeof **out, size, RTI_CL_READ_WRITE, &object, "a buffer", error);
    *out = (rt_gpu_buffer *)(void *)object;
    return status;
}

/* A buffer that calls keep for the next ones, at least so large. */
static rt_status rti_gpu_stage(rt_gpu *gpu, rt_gpu_buffer **buffer, size_t size, rt_error *error)
{
    if (*buffer && (*buffer)->object.bytes >= size) return RT_OK;
    rt_gpu_buffer_free(*buffer);
    *buffer = NULL;
    return rti_gpu_make_buffer(gpu, buffer, size, error);
}

/* Gives up those where bytes that a user asks for do not fit beside them. */
static void rti_gpu_give_way(rt_gpu *gpu, size_t bytes)
{
    rt_gpu_buffer **const kept[] = { &gpu->rays, &gpu->hits, &gpu->times, &gpu->work };
    size_t i;
    if (bytes <= gpu->memory_limit - gpu->used) return;
    for (i = 0; i < sizeof kept / sizeof kept[0]; i++) {
        rt_gpu_buffer_free(*kept[i]);
        *kept[i] = NULL;
    }
}

RT_API rt_status rt_gpu_buffer_new(rt_gpu *gpu, rt_gpu_buffer **out, size_t size, rt_error *error)
{
    if (!gpu || !out) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", gpu ? "out" : "gpu");
    *out = NULL;
    if (!size) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "a buffer of no bytes");
    rti_gpu_give_way(gpu, size);
    return rti_gpu_make_buffer(gpu, out, size, error);
}

RT_API void rt_gpu_buffer_free(rt_gpu_buffer *buffer)
{
    if (buffer) rti_gpu_drop(&buffer->object);
}

static rt_status rti_gpu_range(const rt_gpu_buffer *buffer, size_t offset, const void *memory, size_t size, rt_error *error)
{
    if (!buffer || (!memory && size)) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", buffer ? "memory" : "buffer");
    if (offset > buffer->object.bytes || size > buffer->object.bytes - offset)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "bytes %lu to %lu of a buffer of %lu", (unsigned long)offset,
                        (unsigned long)(offset + size), (unsigned long)buffer->object.bytes);
    return RT_OK;
}

RT_API rt_status rt_gpu_write(rt_gpu_buffer *buffer, size_t offset, const void *from, size_t size, rt_error *error)
{
    const rt_status status = rti_gpu_range(buffer, offset, from, size, error);
    if (status != RT_OK || !size) return status;
    return rti_gpu_send(&buffer->object, offset, from, size, "writing a buffer", error);
}

RT_API rt_status rt_gpu_read(rt_gpu_buffer *buffer, size_t offset, void *to, size_t size, rt_error *error)
{
    rti_cl_int code;
    rt_status status = rti_gpu_range(buffer, offset, to, size, error);
    if (status != RT_OK || !size) return status;
    code = buffer->object.gpu->cl.EnqueueReadBuffer(buffer->object.gpu->queue, buffer->object.mem, 1, offset, size, to, 0, NULL, NULL);
    return code == RTI_CL_SUCCESS ? RT_OK : rti_cl_fail(error, code, "reading a buffer");
}

/* ---- >>gpu-upload --------------------------------------------------------------------------------------------------- */

#define RTI_GPU_ALIGN 64u                   /* bytes: where arrays of an accel begin, a line of caches */

/* rt.h's own RTI_SHARED and RTI_IN are done with: from here on they serve the parts of both files. */
#undef RTI_IN
#define RTI_IN(part) (RTI_TEXT == RTI_TEXT_##part)
/* The parts, in the order in which a program has them; HOST is in none, and LAYOUT and SCENE are C too. */
#define RTI_TEXT_HOST           0
#define RTI_TEXT_LAYOUT         1
#define RTI_TEXT_TYPES          2
#define RTI_TEXT_BASE           3
#define RTI_TEXT_DEVICE         4
#define RTI_TEXT_FRUSTUM        5
#define RTI_TEXT_LANE           6
#define RTI_TEXT_LANES          7
#define RTI_TEXT_EITHER         8
#define RTI_TEXT_PASS           9
#define RTI_TEXT_KD             10
#define RTI_TEXT_THREADED       11
#define RTI_TEXT_WIDE           12
#define RTI_TEXT_INSTANCES      13
#define RTI_TEXT_LEAF           14
#define RTI_TEXT_BVH            15
#define RTI_TEXT_WIDE_BODY      16
#define RTI_TEXT_RUN            17
#define RTI_TEXT_KD_LEAF        18
#define RTI_TEXT_KD_STACK       19
#define RTI_TEXT_KD_RESTART     20
#define RTI_TEXT_THREADED_BODY  21
#define RTI_TEXT_WALK           22
#define RTI_TEXT_RAYS           23
#define RTI_TEXT_TRACE          24
#define RTI_TEXT_LARGE          25
#define RTI_TEXT_SCENE          26
#define RTI_TEXT_COVER          27
#define RTI_TEXT_SHADES         28
#define RTI_TEXT_SHADING        29
#define RTI_TEXT_SHADE          30
#define RTI_TEXT_FRAME          31
#define RTI_TEXT_STEPS          32

#define RTI_TEXT RTI_TEXT_LAYOUT            /* as C */
#include RT_GPU_KERNELS
#undef RTI_TEXT
#ifndef RT_NO_SHADING
#define RTI_TEXT RTI_TEXT_SCENE
#include RT_GPU_KERNELS
#undef RTI_TEXT
#endif

/* What is true of any accel of one level of nesting. */
typedef struct {
    uint32_t structures, kinds, bounds;     /* bits by rt_structure, RTI_TRIANGLE and so on, rt_bounds */
    uint32_t planes, moves;                 /* 1: has some */
    uint32_t depth, wide_depth;             /* of the deepest tree */
} rti_gpu_level;

struct rt_gpu_accel {
    rti_gpu_object object;                  /* records, then the arrays that they tell of */
    rti_gpu_level levels[RT_MAX_NESTING + 1];
    int level_count;
    rt_structure structure;
    unsigned parts;                         /* see rti_parts_of */
};

/* Arrays of an accel on the device. */
typedef enum {
    RTI_GPU_NODES, RTI_GPU_KDNODES, RTI_GPU_KDLINKS, RTI_GPU_KDSLOTS, RTI_GPU_LINKS, RTI_GPU_TRIANGLES, RTI_GPU_BALLS, RTI_GPU_PLANES,
    RTI_GPU_INSTANCES, RTI_GPU_WIDE, RTI_GPU_BASES, RTI_GPU_SLOTS, RTI_GPU_ARRAYS
} rti_gpu_array;

/* An accel on its way to the device. */
typedef struct {
    const rt_accel *accel;
    size_t bytes[RTI_GPU_ARRAYS];
    uint32_t at[RTI_GPU_ARRAYS];            /* in units of RTI_GPU_ALIGN */
    uint32_t level;                         /* that it was last seen at, plus 1 */
    uint32_t wide_depth;
} rti_gpu_part;

/* Numbers things by their address, in the order in which they come. */
typedef struct {
    const void **things;
    size_t count, space;
    uint32_t *table;                        /* of numbers, plus 1; 0: empty; a power of 2, more than twice the count */
    size_t table_size;
    void *user;
} rti_gpu_names;

static size_t rti_gpu_place(const rti_gpu_names *n, const void *thing)
{
    size_t at = (size_t)((uintptr_t)thing / sizeof(void *) * 0x9e3779b97f4a7c15u >> 20) & (n->table_size - 1);
    while (n->table[at] && n->things[n->table[at] - 1] != thing) at = (at + 1) & (n->table_size - 1);
    return at;
}

static bool rti_gpu_grow(rti_gpu_names *n)
{
    const size_t space = n->space ? 2 * n->space : 16;
    const void **things = (const void **)rti_alloc(space, sizeof *things, n->user);
    uint32_t *table = (uint32_t *)rti_alloc(4 * space, sizeof *table, n->user);
    size_t i;
    if (!things || !table) {
        rti_release((void *)things, n->user);
        rti_release(table, n->user);
        return false;
    }
    if (n->count) memcpy((void *)things, (const void *)n->things, n->count * sizeof *things);
    memset(table, 0, 4 * space * sizeof *table);
    rti_release((void *)n->things, n->user);
    rti_release(n->table, n->user);
    n->things = things;
    n->space = space;
    n->table = table;
    n->table_size = 4 * space;
    for (i = 0; i < n->count; i++) table[rti_gpu_place(n, things[i])] = (uint32_t)i + 1;
    return true;
}

/* The number of a thing, which is added where it is new; false: no memory. */
static bool rti_gpu_add(rti_gpu_names *n, const void *thing, uint32_t *number)
{
    size_t at;
    if (n->count == n->space && !rti_gpu_grow(n)) return false;
    at = rti_gpu_place(n, thing);
    if (!n->table[at]) {
        n->things[n->count] = thing;
        n->table[at] = (uint32_t)++n->count;
    }
    *number = n->table[at] - 1;
    return true;
}

#if RTI_INSTANCES || !defined(RT_NO_SHADING)
/* The number of what has been added. */
static uint32_t rti_gpu_number_of(const rti_gpu_names *n, const void *thing) { return n->table[rti_gpu_place(n, thing)] - 1; }
#endif

static void rti_gpu_forget(rti_gpu_names *n)
{
    rti_release((void *)n->things, n->user);
    rti_release(n->table, n->user);
}

typedef struct {
    rt_gpu *gpu;
    rti_gpu_names accels;
    rti_gpu_part *parts;                    /* by number */
} rti_gpu_upload;

/* All accels below, each once. */
static bool rti_gpu_collect(rti_gpu_upload *u, const rt_accel *root)
{
    uint32_t number;
    size_t i;
    bool good = rti_gpu_add(&u->accels, root, &number);
#if RTI_INSTANCES
    size_t done;
    for (done = 0; good && done < u->accels.count; done++) {
        const rt_accel *accel = (const rt_accel *)u->accels.things[done];
        for (i = 0; good && i < accel->slots[RTI_INSTANCE]; i++) good = rti_gpu_add(&u->accels, accel->instances[i].accel, &number);
    }
#endif
    if (good) u->parts = (rti_gpu_part *)rti_alloc(u->accels.count, sizeof *u->parts, u->gpu->memory_user);
    if (!u->parts) return false;
    memset(u->parts, 0, u->accels.count * sizeof *u->parts);
    for (i = 0; i < u->accels.count; i++) u->parts[i].accel = (const rt_accel *)u->accels.things[i];
    return true;
}

/* ---- wide nodes */

#if RTI_BVH

/* Planes that a device finds at origin + step * q, never inside of [lo, hi]; false: the step is too small. */
static bool rti_gpu_quantize(float origin, float step, float lo, float hi, uint8_t *lower, uint8_t *upper)
{
    double a = floor(((double)lo - (double)origin) / (double)step), b = ceil(((double)hi - (double)origin) / (double)step);
    if (a > 255) a = 255;
    if (!(a >= 0) || !(b <= 255)) return false;
    while (a > 0 && origin + step * (float)a > lo) a--;
    while (b <= 255 && origin + step * (float)b < hi) b++;
    if (b > 255) return false;
    *lower = (uint8_t)a;
    *upper = (uint8_t)b;
    return true;
}

static void rti_gpu_compress(const rti_wide *from, int count, rti_gpu_compact *to)
{
    int i, k;
    memset(to, 0, sizeof *to);
    for (i = 0; i < 8; i++) {
        to->index[i] = from->index[i];
        to->count[i] = from->count[i];
    }
    for (k = 0; k < 3; k++) {
        float low = from->bounds[k][0], high = from->bounds[3 + k][0];
        int exponent;
        for (i = 1; i < count; i++) {
            if (from->bounds[k][i] < low) low = from->bounds[k][i];
            if (from->bounds[3 + k][i] > high) high = from->bounds[3 + k][i];
        }
        (void)frexp(((double)high - (double)low) / 255, &exponent);
        if (exponent < -126) exponent = -126;
        for (;; exponent++) {
            const float step = (float)ldexp(1, exponent);
            for (i = 0; i < count; i++)
                if (!rti_gpu_quantize(low, step, from->bounds[k][i], from->bounds[3 + k][i], &to->bounds[k][i], &to->bounds[3 + k][i])) break;
            if (i == count) break;
        }
        to->origin[k] = low;
        to->exponent[k] = (signed char)exponent;
    }
}

/* Collapses the binary tree; answers how many nodes there are, which are written unless to is NULL: a child's number is above its parent's. */
static bool rti_widen(rt_gpu *gpu, const rt_accel *accel, void *to, size_t *count, uint32_t *depth)
{
    rti_collapse c;
    const bool done = rti_begin_collapse(&c, accel, false, gpu->memory_user);
    size_t at;
    for (at = 0; done && to && at < c.wide_count; at++) {
        uint32_t inner = c.plans[at].wide;
        rti_wide wide;
        int i, k, number = 0;
        for (i = 0; i < RTI_CHILDREN; i++) {
            const uint32_t child = c.plans[at].children[i];
            const rti_node *node = child != RTI_END ? &accel->nodes[child] : NULL;
            for (k = 0; k < 6; k++) wide.bounds[k][i] = node ? node->bounds[k] : k < 3 ? RTI_INFINITY : -RTI_INFINITY;
            wide.index[i] = node ? node->count ? node->index : inner++ : 0;
            wide.count[i] = node ? node->count : 0;
            if (node) number++;
        }
        if (gpu->info.gpu) rti_gpu_compress(&wide, number, (rti_gpu_compact *)to + at);
        else ((rti_wide *)to)[at] = wide;
    }
    *count = c.wide_count;
    *depth = c.depth;
    rti_end_collapse(&c, gpu->memory_user);
    return done;
}

#endif

/* ---- arrays */

static bool rti_gpu_measure(rt_gpu *gpu, rti_gpu_part *part)
{
    const rt_accel *a = part->accel;
    size_t *bytes = part->bytes;
    if (a->structure != RT_KDTREE) bytes[RTI_GPU_NODES] = a->node_count * sizeof(rti_node);
#if RTI_KDTREE
    if (a->structure == RT_KDTREE) {
        bytes[RTI_GPU_KDNODES] = a->node_count * sizeof(rti_kdnode);
        if (a->kdlinks) bytes[RTI_GPU_KDLINKS] = a->node_count / 2 * sizeof(rti_kdlink);
        bytes[RTI_GPU_KDSLOTS] = a->kdslot_count * sizeof(uint32_t);
    }
#endif
#if RTI_THREADED
    if (a->structure == RT_THREADED) bytes[RTI_GPU_LINKS] = (size_t)a->orders * a->node_count * sizeof(rti_link);
#endif
    bytes[RTI_GPU_TRIANGLES] = a->slots[RTI_TRIANGLE] * sizeof(rti_triangle);
    bytes[RTI_GPU_BALLS] = a->slots[RTI_SPHERE] * sizeof(rti_ball);
#if RTI_INSTANCES
    bytes[RTI_GPU_INSTANCES] = a->slots[RTI_INSTANCE] * sizeof(rti_gpu_instance);
    bytes[RTI_GPU_BASES] = bytes[RTI_GPU_SLOTS] = a->geo.instance_count * sizeof(uint32_t);
#endif
#if RTI_PLANES
    bytes[RTI_GPU_PLANES] = a->plane_count * sizeof(rti_ground);
#endif
#if RTI_BVH
    if (a->structure == RT_BVH && a->node_count) {
        size_t wide;
        if (!rti_widen(gpu, a, NULL, &wide, &part->wide_depth)) return false;
        bytes[RTI_GPU_WIDE] = wide * (gpu->info.gpu ? sizeof(rti_gpu_compact) : sizeof(rti_wide));
    }
#endif
    (void)gpu;
    return true;
}

/* What an accel's array is, as it stands; NULL: it has to be put together, by rti_gpu_convert. */
static const void *rti_gpu_raw(const rt_accel *a, rti_gpu_array array)
{
    switch (array) {
    case RTI_GPU_NODES: return a->nodes;
#if RTI_KDTREE
    case RTI_GPU_KDNODES: return a->kdnodes;
    case RTI_GPU_KDLINKS: return a->kdlinks;
    case RTI_GPU_KDSLOTS: return a->kdslots;
#endif
#if RTI_THREADED
    case RTI_GPU_LINKS: return a->links;
#endif
    case RTI_GPU_TRIANGLES: return a->triangles;
#if RTI_SPHERES
    case RTI_GPU_BALLS: return a->balls;
#endif
#if RTI_PLANES
    case RTI_GPU_PLANES: return a->planes;
#endif
#if RTI_INSTANCES
    case RTI_GPU_BASES: return a->instance_bases;
    case RTI_GPU_SLOTS: return a->instance_slots;
#endif
    default: return NULL;
    }
}

static bool rti_gpu_convert(rti_gpu_upload *u, const rti_gpu_part *part, rti_gpu_array array, void *to)
{
    const rt_accel *a = part->accel;
    size_t i;
#if RTI_BVH
    uint32_t depth;
    if (array == RTI_GPU_WIDE) return rti_widen(u->gpu, a, to, &i, &depth);
#endif
    (void)u;
    if (array == RTI_GPU_TRIANGLES)
        for (i = 0; i < a->slots[RTI_TRIANGLE]; i++) {
            rti_triangle *triangle = (rti_triangle *)to + i;
            (void)rti_fetch_triangle(&a->geo, triangle->prim = a->triangle_ids[i], triangle->v);
        }
#if RTI_SPHERES
    if (array == RTI_GPU_BALLS)
        for (i = 0; i < a->slots[RTI_SPHERE]; i++) ((rti_ball *)to)[i] = rti_ball_at(a, (uint32_t)i);
#endif
#if RTI_INSTANCES
    if (array == RTI_GPU_INSTANCES)
        for (i = 0; i < a->slots[RTI_INSTANCE]; i++) {
            const rti_instance *in = &a->instances[i];
            rti_gpu_instance *out = (rti_gpu_instance *)to + i;
            memset(out, 0, sizeof *out);
            memcpy(out->transform, in->transform, sizeof out->transform);
            memcpy(out->inverse, in->inverse, sizeof out->inverse);
            out->accel = rti_gpu_number_of(&u->accels, in->accel);
            out->prim = in->prim;
            out->base = in->base;
            out->moves = in->moves;
            if (in->moves) out->motion = in->motion;
        }
#endif
    return true;
}

static void rti_gpu_record_of(const rti_gpu_part *part, rti_gpu_record *r)
{
    const rt_accel *a = part->accel;
    int k;
    memset(r, 0, sizeof *r);
    r->structure = (uint32_t)a->structure;
    r->node_count = (uint32_t)a->node_count;
#if RTI_PLANES
    r->plane_count = (uint32_t)a->plane_count;
#endif
#if RTI_THREADED
    r->bounds = (uint32_t)a->bounds;
    r->orders = (uint32_t)a->orders;
#endif
#if RTI_INSTANCES
    r->moves = a->moves;
    r->instance_count = (uint32_t)a->geo.instance_count;
    r->paths = a->paths;
#endif
    for (k = 0; k < 3; k++) {
#if RTI_THREADED
        r->order_axes[k] = (uint32_t)a->order_axes[k];
#endif
        r->slots[k] = (uint32_t)a->slots[k];
        r->lower[k] = a->lower[k];
        r->upper[k] = a->upper[k];
    }
    r->extent = a->extent;
    r->spread = a->spread;
    r->nodes = part->at[RTI_GPU_NODES];
    r->kdnodes = part->at[RTI_GPU_KDNODES];
    r->kdlinks = part->at[RTI_GPU_KDLINKS];
    r->kdslots = part->at[RTI_GPU_KDSLOTS];
    r->links = part->at[RTI_GPU_LINKS];
    r->triangles = part->at[RTI_GPU_TRIANGLES];
    r->balls = part->at[RTI_GPU_BALLS];
    r->planes = part->at[RTI_GPU_PLANES];
    r->instances = part->at[RTI_GPU_INSTANCES];
    r->wide = part->at[RTI_GPU_WIDE];
    r->instance_bases = part->at[RTI_GPU_BASES];
    r->instance_slots = part->at[RTI_GPU_SLOTS];
}

static void rti_gpu_note_level(rti_gpu_level *level, const rti_gpu_part *part)
{
    const rt_accel *a = part->accel;
    int k;
    if (a->node_count) level->structures |= 1u << a->structure;
    for (k = 0; k < RTI_KINDS; k++)
        if (a->slots[k]) level->kinds |= 1u << k;
#if RTI_THREADED
    if (a->structure == RT_THREADED) level->bounds |= 1u << a->bounds;
#endif
#if RTI_PLANES
    if (a->plane_count) level->planes = 1;
#endif
#if RTI_INSTANCES
    if (a->moves) level->moves = 1;
#endif
    if ((uint32_t)a->depth > level->depth) level->depth = (uint32_t)a->depth;
    if (part->wide_depth > level->wide_depth) level->wide_depth = part->wide_depth;
}

/* Which accels are how far down: an accel may be at several levels. */
static bool rti_gpu_note_levels(rti_gpu_upload *u, rt_gpu_accel *there)
{
    void *const user = u->gpu->memory_user;
    uint32_t *list = (uint32_t *)rti_alloc(2 * u->accels.count, sizeof *list, user), *now = list, *next;
    size_t n = 1, more, i;
    if (!list) return false;
    next = list + u->accels.count;
    now[0] = 0;
    for (there->level_count = 0; n; there->level_count++) {
        more = 0;
        for (i = 0; i < n; i++) {
            const rt_accel *a = u->parts[now[i]].accel;
            rti_gpu_note_level(&there->levels[there->level_count], &u->parts[now[i]]);
#if RTI_INSTANCES
            {
                size_t j;
                for (j = 0; j < a->slots[RTI_INSTANCE]; j++) {
                    const uint32_t child = rti_gpu_number_of(&u->accels, a->instances[j].accel);
                    if (u->parts[child].level == (uint32_t)there->level_count + 1) continue;
                    u->parts[child].level = (uint32_t)there->level_count + 1;
                    next[more++] = child;
                }
            }
#else
            (void)a;
#endif
        }
        n = more;
        now = next;
        next = now == list ? list + u->accels.count : list;
    }
    rti_release(list, user);
    return true;
}

static rt_status rti_gpu_send_parts(rti_gpu_upload *u, rt_gpu_accel *there, rt_error *error)
{
    void *const user = u->gpu->memory_user;
    rti_gpu_record *records = (rti_gpu_record *)rti_alloc(u->accels.count, sizeof *records, user);
    rt_status status = records ? RT_OK : RT_ERROR_MEMORY;
    size_t i;
    int array;
    for (i = 0; i < u->accels.count && status == RT_OK; i++) {
        const rti_gpu_part *part = &u->parts[i];
        rti_gpu_record_of(part, &records[i]);
        for (array = 0; array < RTI_GPU_ARRAYS && status == RT_OK; array++) {
            const void *from = rti_gpu_raw(part->accel, (rti_gpu_array)array);
            const size_t at = (size_t)part->at[array] * RTI_GPU_ALIGN, bytes = part->bytes[array];
            void *copy = NULL;
            if (!bytes) continue;
            if (!from) {
                from = copy = rti_alloc(bytes, 1, user);
                if (!copy || !rti_gpu_convert(u, part, (rti_gpu_array)array, copy)) status = RT_ERROR_MEMORY;
            }
            if (status == RT_OK) status = rti_gpu_send(&there->object, at, from, bytes, "copying an accel", error);
            else (void)rti_fail(error, status, RT_NONE, "no memory to copy an accel");
            rti_release(copy, user);
        }
    }
    if (!records) (void)rti_fail(error, status, RT_NONE, "no memory to copy an accel");
    else if (status == RT_OK) status = rti_gpu_send(&there->object, 0, records, u->accels.count * sizeof *records, "copying an accel", error);
    rti_release(records, user);
    return status;
}

RT_API rt_status rt_gpu_upload(rt_gpu *gpu, rt_gpu_accel **out, const rt_accel *accel, rt_error *error)
{
    rti_gpu_upload u;
    rti_gpu_object *object = NULL;
    rt_status status = RT_OK;
    uint64_t units;
    size_t i;
    int array;
    bool good;
    if (!gpu || !out || !accel) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", !gpu ? "gpu" : out ? "accel" : "out");
    *out = NULL;
    if (rti_only_wide(accel))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "kernels read the binary tree, which this accel was built without (no_binary): build "
                        "it with");
    memset(&u, 0, sizeof u);
    u.gpu = gpu;
    u.accels.user = gpu->memory_user;
    good = rti_gpu_collect(&u, accel);
    units = (u.accels.count * sizeof(rti_gpu_record) + RTI_GPU_ALIGN - 1) / RTI_GPU_ALIGN;
    for (i = 0; i < u.accels.count && good; i++) {
        good = rti_gpu_measure(gpu, &u.parts[i]);
        for (array = 0; array < RTI_GPU_ARRAYS && good; array++) {
            if (u.parts[i].bytes[array]) u.parts[i].at[array] = (uint32_t)units;
            units += (u.parts[i].bytes[array] + RTI_GPU_ALIGN - 1) / RTI_GPU_ALIGN;
        }
    }
    if (!good) status = rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "no memory to copy an accel");
    else if (units > 0xffffffffu) status = rti_fail(error, RT_ERROR_LIMIT, RT_NONE, "accels of more than 256 GB together");
    else {
        rti_gpu_give_way(gpu, (size_t)units * RTI_GPU_ALIGN);
        status = rti_gpu_make(gpu, sizeof **out, (size_t)units * RTI_GPU_ALIGN, RTI_CL_READ_ONLY, &object, "an accel", error);
    }
    if (status == RT_OK) {
        rt_gpu_accel *there = (rt_gpu_accel *)(void *)object;
        there->structure = accel->structure;
        there->parts = rti_parts_of(accel) | 1u << RTI_PART_WIDE;      /* made here */
        if (!rti_gpu_note_levels(&u, there)) status = rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "no memory to copy an accel");
        else status = rti_gpu_send_parts(&u, there, error);
        if (status == RT_OK) *out = there;
        else rti_gpu_drop(object);
    }
    rti_release(u.parts, gpu->memory_user);
    rti_gpu_forget(&u.accels);
    return status;
}

RT_API void rt_gpu_free(rt_gpu_accel *accel)
{
    if (accel) rti_gpu_drop(&accel->object);
}

RT_API size_t rt_gpu_bytes(const rt_gpu_accel *accel) { return accel->object.bytes; }

/* ---- >>gpu-text ----------------------------------------------------------------------------------------------------- */

#undef RTI_SHARED
#define RTI_GPU_STRING(x) #x
#define RTI_GPU_LINE(n) "\n#line " RTI_GPU_STRING(n) "\n"
#define RTI_SHARED(...) RTI_GPU_LINE(__LINE__) #__VA_ARGS__ "\n",

/* What programs are put together from; a NULL ends each part, and they stand in the order of their numbers. */
static const char *const rti_gpu_texts[] = {
    NULL, NULL,                             /* HOST, and LAYOUT, which follows TYPES */
#define RTI_TEXT RTI_TEXT_TYPES
#include RT_GPU_KERNELS
#undef RTI_TEXT
#define RTI_TEXT RTI_TEXT_LAYOUT
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_BASE
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_DEVICE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_FRUSTUM
#include RT_SELF
#undef RTI_TEXT
#define RTI_PASS                            /* where the rest of rt.h stands */
    "", NULL,
#define RTI_TEXT RTI_TEXT_LANE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_LANES
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_EITHER
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_PASS
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_KD
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_THREADED
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_WIDE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_INSTANCES
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_LEAF
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_BVH
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_WIDE_BODY
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_RUN
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_KD_LEAF
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_KD_STACK
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_KD_RESTART
#include RT_SELF
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_THREADED_BODY
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_WALK
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_RAYS
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_TRACE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_LARGE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#undef RTI_PASS
#ifndef RT_NO_SHADING
#define RTI_TEXT RTI_TEXT_SCENE
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_COVER
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_SHADES
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_SHADING
#include RT_SELF
#undef RTI_TEXT
#define RTI_PASS
    "", NULL,
#define RTI_TEXT RTI_TEXT_SHADE
#include RT_SELF
#undef RTI_TEXT
#undef RTI_PASS
    "", NULL,
#define RTI_TEXT RTI_TEXT_FRAME
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL,
#define RTI_TEXT RTI_TEXT_STEPS
#include RT_GPU_KERNELS
#undef RTI_TEXT
    "", NULL
#endif
};

/* Text that grows; size 0 once memory has run out. */
typedef struct { char *text; size_t length, size; void *user; } rti_gpu_source;

static void rti_gpu_append(rti_gpu_source *s, const char *text)
{
    const size_t length = strlen(text);
    if (!s->size) return;
    if (s->length + length + 1 > s->size) {
        const size_t size = 2 * (s->size + length);
        char *more = (char *)rti_alloc(size, 1, s->user);
        if (more) memcpy(more, s->text, s->length);
        rti_release(s->text, s->user);
        s->text = more;
        s->size = more ? size : 0;
        if (!more) return;
    }
    memcpy(s->text + s->length, text, length + 1);
    s->length += length;
}

RTI_PRINTF(2, 3)
static void rti_gpu_define(rti_gpu_source *s, const char *format, ...)
{
    char line[256];
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    rti_gpu_append(s, "#define ");
    rti_gpu_append(s, line);
    rti_gpu_append(s, "\n");
}

static void rti_gpu_append_part(rti_gpu_source *s, int part)
{
    size_t i = 0;
    for (; part; i++)
        if (!rti_gpu_texts[i]) part--;
    for (; rti_gpu_texts[i]; i++) rti_gpu_append(s, rti_gpu_texts[i]);
}

/* ---- >>gpu-program -------------------------------------------------------------------------------------------------- */

/* Which program: all that it is compiled for. Compared as bytes. */
typedef struct {
    uint32_t algorithm, query, width, entries, cull;
    uint32_t general;                       /* 1: algorithm and cull stand for all of their kind, and entries for as many or fewer */
    uint32_t level_count;
    rti_gpu_level levels[RT_MAX_NESTING + 1];
    uint32_t kind;                          /* rti_gpu_kind_of_program; of RTI_GPU_FRAMES: */
    uint32_t shows;                         /* bits by rti_gpu_things */
    uint32_t sampler, filter, lens_open, timed, spread;
} rti_gpu_key;

/* For batches of rays; for pictures; for eye rays that are rasterised. Each has these kernels. */
typedef enum { RTI_GPU_BATCHES, RTI_GPU_FRAMES, RTI_GPU_COVERS } rti_gpu_kind_of_program;
enum { RTI_GPU_LOOK, RTI_GPU_MEET, RTI_GPU_AIM, RTI_GPU_SHINE, RTI_GPU_BOUNCE, RTI_GPU_KERNEL_COUNT };
static const char *const rti_gpu_kernel_names[][RTI_GPU_KERNEL_COUNT] = {
    { "rt_gpu_trace", NULL, NULL, NULL, NULL },
    { "rt_gpu_look", "rt_gpu_meet", "rt_gpu_aim", "rt_gpu_shine", "rt_gpu_bounce" },
    { "rt_gpu_cover", "rt_gpu_find_slots", NULL, NULL, NULL }
};

struct rti_gpu_program {
    rti_gpu_program *next;
    rti_gpu_key key;
    rti_cl program, kernels[RTI_GPU_KERNEL_COUNT];
    size_t group;                           /* work-items of a group at most */
};

/* Names that stand in a program once a level. */
#define RTI_LEVEL_NAMES(X) X(rti_hit_instances) X(rti_hit_leaf) X(rti_hit_run) X(rti_walk_body) X(rti_wide_body) X(rti_kd_hit_leaf) \
    X(rti_kd_stack_body) X(rti_kd_restart_body) X(rti_thread_body) X(rti_walk)

/* Numbers of rt.h that shared text uses. */
#ifdef RT_NO_SHADING
#define RTI_GPU_SHADING_NUMBERS(X)
#else
#define RTI_GPU_SURFACE (RTI_LANE_COUNT + 6)        /* numbers that are kept of a surface */
#if RTI_SAMPLING
#define RTI_GPU_SHADING_NUMBERS(X) X(RTI_GPU_SURFACE) X(RT_TEXTURE_IMAGE) X(RT_TEXTURE_CHECKER) X(RT_SAMPLER_INDEPENDENT) \
    X(RT_SAMPLER_STRATIFIED) X(RT_FILTER_TENT) X(RT_FILTER_GAUSSIAN)
#else
#define RTI_GPU_SHADING_NUMBERS(X) X(RTI_GPU_SURFACE) X(RT_TEXTURE_IMAGE) X(RT_TEXTURE_CHECKER)
#endif
#endif
#define RTI_GPU_NUMBERS(X) RTI_GPU_SHADING_NUMBERS(X) X(RT_CLOSEST) X(RT_ANY) X(RT_KDTREE) X(RT_KD_STACK) X(RT_KD_RESTART) X(RT_KD_BACKTRACK) \
    X(RT_BVH_MASKED) X(RT_BVH_PARTITION) X(RT_CULL_NONE) X(RT_CULL_CORNERS) X(RT_CULL_PLANES) \
    X(RTI_TRIANGLE) X(RTI_SPHERE) X(RTI_INSTANCE) X(RTI_WALK_ANY) X(RTI_WALK_ALL) X(RTI_WALK_COUNT) X(RTI_WALK_LIKELY) \
    X(RTI_KIND_SHIFT) X(RTI_MIXED) X(RTI_KD_PAIR) X(RTI_SEEN)
#define RTI_GPU_BITS(X) X(RT_NONE) X(RTI_END) X(RTI_COUNT_MASK) X(RTI_LEAF) X(RTI_KD_LOWER_EMPTY) X(RTI_KD_EMPTY) \
    X(RTI_GPU_ALIGN)
#define RTI_GPU_FLOATS(X) X(RT_MAX_COORDINATE) X(RT_MIN_DIRECTION) X(RT_MAX_DIRECTION) X(RTI_STEEP)

static bool rti_gpu_is_large(uint32_t algorithm) { return algorithm >= RT_BVH_MASKED && algorithm <= RT_BVH_PARTITION; }

/* Large packets: may there be a frustum? Do work-items read each other's rays, and how many numbers of one (see rti_row)? */
static bool rti_gpu_culls(const rti_gpu_key *key) { return key->general || key->cull; }
static bool rti_gpu_shares(const rt_gpu *gpu, const rti_gpu_key *key) { return !gpu->info.gpu || key->general || key->algorithm == RT_BVH_PARTITION; }
static uint32_t rti_gpu_rows(const rt_gpu *gpu) { return gpu->info.gpu ? 9 : 11; }

/* All that holds for the whole program. */
static void rti_gpu_define_all(rti_gpu_source *s, const rt_gpu *gpu, const rti_gpu_key *key)
{
    uint32_t i, lane;
    bool moves = false;
#define RTI_GPU_INT(name) rti_gpu_define(s, #name " %d", (int)(name));
#define RTI_GPU_UINT(name) rti_gpu_define(s, #name " %uu", (unsigned)(name));
#define RTI_GPU_FLOAT(name) rti_gpu_define(s, #name " %af", (double)(name));
    RTI_GPU_NUMBERS(RTI_GPU_INT)
    RTI_GPU_BITS(RTI_GPU_UINT)
    RTI_GPU_FLOATS(RTI_GPU_FLOAT)
    for (i = 0; i < key->level_count; i++) moves |= key->levels[i].moves != 0;
    rti_gpu_define(s, "RTI_GPU %d", (int)gpu->info.gpu);
    rti_gpu_define(s, "RTI_CALL static%s", gpu->info.gpu ? "" : " __attribute__((noinline))");
    rti_gpu_define(s, "RTI_NOINLINE RTI_CALL");
    rti_gpu_define(s, "RTI_WIDE_NODE %s", gpu->info.gpu ? "rti_gpu_compact" : "rti_wide");
    rti_gpu_define(s, "RTI_QUERY %u", key->query);
    if (key->general) {
        rti_gpu_define(s, "RTI_ALGORITHM algorithm");
        rti_gpu_define(s, "RTI_ENTRIES entries");
        rti_gpu_define(s, "RTI_CULL cull");
    } else {
        rti_gpu_define(s, "RTI_ALGORITHM %u", key->algorithm);
        rti_gpu_define(s, "RTI_ENTRIES %u", key->entries);
        rti_gpu_define(s, "RTI_CULL %u", key->cull);
    }
    rti_gpu_define(s, "RTI_CULLS %d", (int)rti_gpu_culls(key));
    rti_gpu_define(s, "RTI_SHARES %d", (int)rti_gpu_shares(gpu, key));
    rti_gpu_define(s, "RTI_ROWS %u", rti_gpu_rows(gpu));
    rti_gpu_define(s, "RTI_SHORT_STACK %u", key->entries ? key->entries : 1);
    rti_gpu_define(s, "RTI_MOVES %d", (int)moves);
    rti_gpu_define(s, "RTI_WIDTH %u", key->width);
    rti_gpu_define(s, "RTI_ALL_LANES %uu", (1u << key->width) - 1);
    rti_gpu_define(s, "RTI_VECTOR(name) name##%u", key->width);
    rti_gpu_append(s, "#define RTI_LANE_BITS (RTI_VECTOR(int))(");
    for (lane = 0; lane < key->width; lane++) {
        char bit[16];
        snprintf(bit, sizeof bit, lane ? ", %u" : "%u", 1u << lane);
        rti_gpu_append(s, bit);
    }
    rti_gpu_append(s, ")\n");
    rti_gpu_define(s, "RTI_KNOWN_SIDES(p) (RTI_WIDTH == 1 || (p)->uniform)");
#if RTI_INSTANCES
    rti_gpu_define(s, "RTI_INSTANCE_TYPE rti_gpu_instance");
#else
    rti_gpu_define(s, "RTI_INSTANCE_TYPE char");
    rti_gpu_define(s, "rti_clamp_time(time) 0");
#endif
#if !RTI_PLANES
    rti_gpu_define(s, "rti_hit_planes(a, b, c, d, e) 0u");
#endif
}

/* A test that holds for all accels of a level, or for none, is not made. */
static void rti_gpu_define_test(rti_gpu_source *s, const char *name, const char *field, uint32_t has, uint32_t wanted)
{
    const char *const test = !(has & 1u << wanted) ? "false" : has == 1u << wanted ? "true" : NULL;
    if (test) rti_gpu_define(s, "%s(accel) %s", name, test);
    else rti_gpu_define(s, "%s(accel) ((accel)->%s == %u)", name, field, wanted);
}

/* What an accel of level i does, its instances calling the level below, which stands before it. */
static void rti_gpu_append_level(rti_gpu_source *s, const rti_gpu_key *key, uint32_t i)
{
    static const char *const names[] = {
#define RTI_GPU_NAME(name) #name,
        RTI_LEVEL_NAMES(RTI_GPU_NAME)
        "rti_walk_child", "rti_walk_bvh", "rti_hit_spheres", "RTI_STACK", "RTI_WALK_FLAGS", "RTI_HAS_PLANES", "RTI_IS_KDTREE", "RTI_IS_THREADED", "RTI_IS_ROUND"
    };
    const rti_gpu_level *level = &key->levels[i];
    const bool wide = key->algorithm == RT_BVH_WIDE, bvh = (level->structures & 1u << RT_BVH) != 0;
    const bool kd = (level->structures & 1u << RT_KDTREE) != 0, threaded = (level->structures & 1u << RT_THREADED) != 0;
    const bool stack = key->general || key->algorithm == RT_KD_STACK || key->algorithm == RT_KD_BACKTRACK;
    const bool restart = key->general || key->algorithm != RT_KD_STACK;
    const bool instances = i + 1 < key->level_count, large = !i && rti_gpu_is_large(key->algorithm);     /* walked in LARGE */
    const uint32_t all = level->kinds & ~(1u << RTI_TRIANGLE) ? RTI_WALK_ALL : 0, any = key->query == RT_ANY ? RTI_WALK_ANY : 0;
    uint32_t depth = level->depth > 0 ? level->depth : 1;
    size_t n;
    for (n = 0; n < sizeof names / sizeof names[0]; n++) {
        rti_gpu_append(s, "#undef ");
        rti_gpu_append(s, names[n]);
        rti_gpu_append(s, "\n");
    }
#define RTI_GPU_RENAME(name) rti_gpu_define(s, #name " " #name "_%u", i);
#define RTI_GPU_GONE(name, arguments) { rti_gpu_append(s, "#undef " #name "\n"); rti_gpu_define(s, #name arguments " 0u"); }
    RTI_LEVEL_NAMES(RTI_GPU_RENAME)
    rti_gpu_define(s, "rti_walk_child rti_walk_%u", i + 1);
    rti_gpu_define(s, "rti_walk_bvh %s_%u", wide ? "rti_wide_body" : "rti_walk_body", i);
    if (wide && bvh && 7 * level->wide_depth + 8 > depth) depth = 7 * level->wide_depth + 8;
    rti_gpu_define(s, "RTI_STACK %u", depth);
    rti_gpu_define(s, "RTI_WALK_FLAGS %u", all | any);
    rti_gpu_define(s, "RTI_HAS_PLANES %s", level->planes ? "true" : "false");
    rti_gpu_define_test(s, "RTI_IS_KDTREE", "structure", level->structures, RT_KDTREE);
    rti_gpu_define_test(s, "RTI_IS_THREADED", "structure", level->structures, RT_THREADED);
    rti_gpu_define_test(s, "RTI_IS_ROUND", "bounds", level->bounds, RT_BOUNDS_SPHERES);
    if (!(level->kinds & 1u << RTI_SPHERE)) RTI_GPU_GONE(rti_hit_spheres, "(a, b, c, d, e, f, g, h)")
    if (!instances) RTI_GPU_GONE(rti_hit_instances, "(a, b, c, d, e, f, g, h)")
    else {
        /* inlined, so that a level is one call: PoCL 3.1 takes twice as long for every function that calls go on through */
        rti_gpu_append(s, "#undef RTI_NOINLINE\n");
        rti_gpu_define(s, "RTI_NOINLINE RTI_FN");
        rti_gpu_append_part(s, RTI_TEXT_INSTANCES);
        rti_gpu_append(s, "#undef RTI_NOINLINE\n");
        rti_gpu_define(s, "RTI_NOINLINE RTI_CALL");
    }
    rti_gpu_append_part(s, RTI_TEXT_LEAF);
    if (large) return;
    if (!bvh) RTI_GPU_GONE(rti_walk_bvh, "(a, b, c, d, e, f)")
    else rti_gpu_append_part(s, wide ? RTI_TEXT_WIDE_BODY : RTI_TEXT_BVH);
    if (kd) rti_gpu_append_part(s, RTI_TEXT_RUN);
    if (kd) rti_gpu_append_part(s, RTI_TEXT_KD_LEAF);
    if (!kd || !stack) RTI_GPU_GONE(rti_kd_stack_body, "(a, b, c, d, e, f)")
    else rti_gpu_append_part(s, RTI_TEXT_KD_STACK);
    if (!kd || !restart) RTI_GPU_GONE(rti_kd_restart_body, "(a, b, c, d, e, f)")
    else rti_gpu_append_part(s, RTI_TEXT_KD_RESTART);
    if (!threaded) RTI_GPU_GONE(rti_thread_body, "(a, b, c, d, e, f)")
    else rti_gpu_append_part(s, RTI_TEXT_THREADED_BODY);
    rti_gpu_append_part(s, RTI_TEXT_WALK);
}

#ifndef RT_NO_SHADING
/* What a scene may show; RTI_SHOWS of rt.h. */
#define RTI_GPU_THINGS(X) X(SHAPES) X(INSTANCES) X(TEXTURES) X(GLASS) X(ROUGHNESS) X(LAMPS)
#define RTI_GPU_THING(name) RTI_GPU_##name##_BIT,
#define RTI_GPU_SHOWN(name) RTI_GPU_SHOWS_##name = 1 << RTI_GPU_##name##_BIT,
enum { RTI_GPU_THINGS(RTI_GPU_THING) RTI_GPU_THING_COUNT };
enum { RTI_GPU_THINGS(RTI_GPU_SHOWN) RTI_GPU_SHOWS_ALL = (1 << RTI_GPU_THING_COUNT) - 1 };

/* Of the general program what a picture has is asked each time. */
static void rti_gpu_define_choice(rti_gpu_source *s, const rti_gpu_key *key, const char *name, const char *field, uint32_t value)
{
    if (key->general) rti_gpu_define(s, "%s frame->%s", name, field);
    else rti_gpu_define(s, "%s %u", name, value);
}

static void rti_gpu_write_frame(rti_gpu_source *s, const rti_gpu_key *key)
{
#define RTI_GPU_SHOW(name) rti_gpu_define(s, "RTI_SHOWS_" #name " %s", key->shows >> RTI_GPU_##name##_BIT & 1 ? "true" : "false");
    RTI_GPU_THINGS(RTI_GPU_SHOW)
    rti_gpu_define_choice(s, key, "RTI_SAMPLER_KIND", "sampler", key->sampler);
    rti_gpu_define_choice(s, key, "RTI_FILTER_KIND", "filter", key->filter);
    rti_gpu_define_choice(s, key, "RTI_LENS_OPEN", "lens_open", key->lens_open);
    rti_gpu_define_choice(s, key, "RTI_TIMED", "timed", key->timed);
    rti_gpu_define_choice(s, key, "RTI_SPREAD", "spread", key->spread);
    rti_gpu_append_part(s, RTI_TEXT_SCENE);
    rti_gpu_append_part(s, RTI_TEXT_SHADES);
    rti_gpu_append_part(s, RTI_TEXT_SHADING);
    rti_gpu_append_part(s, RTI_TEXT_SHADE);
    rti_gpu_append_part(s, RTI_TEXT_FRAME);
    rti_gpu_append_part(s, RTI_TEXT_STEPS);
}
#endif

static void rti_gpu_write_program(rti_gpu_source *s, const rt_gpu *gpu, const rti_gpu_key *key)
{
    const bool large = rti_gpu_is_large(key->algorithm);
    bool kd = false, threaded = false;
    uint32_t i;
    for (i = 0; i < key->level_count; i++) {
        kd |= (key->levels[i].structures & 1u << RT_KDTREE) != 0;
        threaded |= (key->levels[i].structures & 1u << RT_THREADED) != 0;
    }
    rti_gpu_define_all(s, gpu, key);
    rti_gpu_append_part(s, RTI_TEXT_TYPES);
    rti_gpu_append_part(s, RTI_TEXT_BASE);
    rti_gpu_append_part(s, RTI_TEXT_DEVICE);
    if (large) rti_gpu_append_part(s, RTI_TEXT_FRUSTUM);
    rti_gpu_append_part(s, key->width == 1 ? RTI_TEXT_LANE : RTI_TEXT_LANES);
    rti_gpu_append_part(s, RTI_TEXT_EITHER);
#ifndef RT_NO_SHADING
    if (key->kind == RTI_GPU_FRAMES) {
        rti_gpu_write_frame(s, key);
        return;
    }
#endif
    rti_gpu_append_part(s, RTI_TEXT_PASS);
    if (kd) rti_gpu_append_part(s, RTI_TEXT_KD);
    if (threaded) rti_gpu_append_part(s, RTI_TEXT_THREADED);
    if (key->algorithm == RT_BVH_WIDE) rti_gpu_append_part(s, RTI_TEXT_WIDE);
    for (i = key->level_count; i-- > 0;) rti_gpu_append_level(s, key, i);
    rti_gpu_append_part(s, RTI_TEXT_RAYS);
#ifndef RT_NO_SHADING
    if (key->kind == RTI_GPU_COVERS) {
        rti_gpu_append_part(s, RTI_TEXT_SCENE);
        rti_gpu_append_part(s, RTI_TEXT_COVER);
        return;
    }
#endif
    rti_gpu_append_part(s, large ? RTI_TEXT_LARGE : RTI_TEXT_TRACE);
}

/* The compiler's words to gpu->log, and the first of them that say error to the message. */
static rt_status rti_gpu_refused(rt_gpu *gpu, rti_cl program, rti_cl_int code, rt_error *error)
{
    size_t size = 0;
    const char *first;
    rti_release(gpu->log, gpu->memory_user);
    gpu->log = NULL;
    if (code != RTI_CL_BUILD_FAILURE) return rti_cl_fail(error, code, "compiling a program");
    if (gpu->cl.GetProgramBuildInfo(program, gpu->device, RTI_CL_BUILD_LOG, 0, NULL, &size) == RTI_CL_SUCCESS && size)
        gpu->log = (char *)rti_alloc(size + 1, 1, gpu->memory_user);
    if (!gpu->log || gpu->cl.GetProgramBuildInfo(program, gpu->device, RTI_CL_BUILD_LOG, size, gpu->log, NULL) != RTI_CL_SUCCESS)
        return rti_fail(error, RT_ERROR_UNSUPPORTED, RT_NONE, "device %.64s cannot compile a program, and does not say why", gpu->info.name);
    gpu->log[size] = 0;
    first = strstr(gpu->log, "error");
    if (!first) first = gpu->log;
    return rti_fail(error, RT_ERROR_UNSUPPORTED, RT_NONE, "device %.64s cannot compile a program: %.*s", gpu->info.name, (int)strcspn(first, "\n"), first);
}

static void rti_gpu_release_program(rt_gpu *gpu, rti_gpu_program *program)
{
    int i;
    for (i = 0; i < RTI_GPU_KERNEL_COUNT; i++)
        if (program->kernels[i]) gpu->cl.ReleaseKernel(program->kernels[i]);
    if (program->program) gpu->cl.ReleaseProgram(program->program);
}

/* Of what a driver tells of a kernel; 0: it does not. */
static size_t rti_gpu_kernel_number(const rt_gpu *gpu, rti_cl kernel, rti_cl_uint what)
{
    union { uint64_t wide; size_t size; } number;
    number.wide = 0;
    if (gpu->cl.GetKernelWorkGroupInfo(kernel, gpu->device, what, sizeof number, &number, NULL) != RTI_CL_SUCCESS) return 0;
    return what == RTI_CL_GROUP_SIZE ? number.size : (size_t)number.wide;
}

static rt_status rti_gpu_compile(rt_gpu *gpu, const rti_gpu_key *key, rti_gpu_program **out, rt_error *error)
{
    const char *const *const names = rti_gpu_kernel_names[key->kind];
    /* -w: what PoCL's compiler says of vectors wider than the processor's goes to stderr */
    const char *const flags = gpu->info.exact ? "-cl-std=CL1.2 -w -cl-fp32-correctly-rounded-divide-sqrt " : "-cl-std=CL1.2 -w ";
    const size_t length = strlen(flags) + strlen(gpu->flags) + 1;
    rti_gpu_program *program = (rti_gpu_program *)rti_alloc(1, sizeof *program, gpu->memory_user);
    char *all = (char *)rti_alloc(length, 1, gpu->memory_user);
    rti_gpu_source s;
    rti_cl_int code = RTI_CL_SUCCESS;
    rt_status status = RT_OK;
    int i;
    s.length = 0;
    s.size = 1 << 16;
    s.user = gpu->memory_user;
    s.text = (char *)rti_alloc(s.size, 1, s.user);
    if (!s.text) s.size = 0;
    rti_gpu_write_program(&s, gpu, key);
    if (!s.size || !program || !all) status = rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "no memory for a program");
    else {
        const char *text = s.text;
        snprintf(all, length, "%s%s", flags, gpu->flags);
        memset(program, 0, sizeof *program);
        program->key = *key;
        program->program = gpu->cl.CreateProgramWithSource(gpu->context, 1, &text, &s.length, &code);
        if (program->program) code = gpu->cl.BuildProgram(program->program, 1, &gpu->device, all, NULL, NULL);
        for (i = 0; i < RTI_GPU_KERNEL_COUNT && names[i] && code == RTI_CL_SUCCESS; i++)
            program->kernels[i] = gpu->cl.CreateKernel(program->program, names[i], &code);
        if (code != RTI_CL_SUCCESS) {
            status = rti_gpu_refused(gpu, program->program, code, error);
            rti_gpu_release_program(gpu, program);
        } else program->group = rti_gpu_kernel_number(gpu, program->kernels[0], RTI_CL_GROUP_SIZE);
    }
    rti_release(all, gpu->memory_user);
    rti_release(s.text, s.user);
    if (status != RT_OK) {
        rti_release(program, gpu->memory_user);
        return status;
    }
    program->next = gpu->programs;
    gpu->programs = program;
    gpu->program_count++;
    *out = program;
    return RT_OK;
}

static void rti_gpu_free_programs(rt_gpu *gpu)
{
    while (gpu->programs) {
        rti_gpu_program *program = gpu->programs;
        gpu->programs = program->next;
        rti_gpu_release_program(gpu, program);
        rti_release(program, gpu->memory_user);
    }
}

/* Depths in steps, so that scenes alike share programs. */
static uint32_t rti_gpu_round_depth(uint32_t depth, uint32_t step) { return (depth + step - 1) / step * step; }

/* What the program must be able to do, or, where it may be general, what it may have to. */
static void rti_gpu_set_levels(const rt_gpu *gpu, const rt_gpu_accel *accel, rti_gpu_key *key)
{
    const uint32_t levels = (uint32_t)accel->level_count;
    int i;
    key->level_count = levels;
    if (gpu->general && RTI_INSTANCES) key->level_count = levels <= 2 ? 2 : levels <= 4 ? 4 : levels;       /* all that is deeper would take a minute */
    for (i = 0; i < (int)key->level_count; i++) {
        rti_gpu_level *level = &key->levels[i];
        *level = accel->levels[i];
        level->depth = rti_gpu_round_depth(level->depth, 8);
        level->wide_depth = rti_gpu_round_depth(level->wide_depth, 2);
        if (!gpu->general) continue;
        if (!i) level->structures = 1u << accel->structure;
        else if (levels <= 4) level->structures = (RTI_BVH ? 1u << RT_BVH : 0) | (RTI_KDTREE ? 1u << RT_KDTREE : 0) | (RTI_THREADED ? 1u << RT_THREADED : 0);
        level->kinds = 1u << RTI_TRIANGLE | (RTI_SPHERES ? 1u << RTI_SPHERE : 0) | (RTI_INSTANCES ? 1u << RTI_INSTANCE : 0);
        level->bounds = RTI_THREADED ? 3 : 0;
        level->planes = RTI_PLANES;
        level->moves = RTI_INSTANCES;
        level->depth = RTI_MAX_DEPTH;
        level->wide_depth = 16 > level->wide_depth ? 16 : level->wide_depth;
    }
}

/* ---- >>gpu-run ------------------------------------------------------------------------------------------------------ */

/* A call of rt_gpu_trace, resolved. */
typedef struct {
    rti_gpu_program *program;
    int32_t algorithm, entries, cull;       /* for those that are for several */
    uint32_t side;                          /* of large packets: rays a side; 0: packets of a work-item */
    uint32_t items, rows, numbers;          /* their work-items, and local memory: floats and 16 bits */
} rti_gpu_task;

/* Packet widths in the rt_trace_options sense that there are kernels for. */
static const int *rti_gpu_width_list(rt_algorithm algorithm, size_t *n)
{
    static const int one[] = { 1 }, lanes[] = { 1, 2, 8, 16 }, rays[] = { 2, 4, 8, 16 }, sides[] = { 4, 8, 16, RT_MAX_PACKET };
    *n = 4;
    if (algorithm == RT_THREADED_PARALLEL) return rays;
    if (algorithm == RT_BVH_SIMD || (algorithm >= RT_KD_STACK && algorithm < RT_KD_BACKTRACK)) return lanes;
    if (rti_gpu_is_large((uint32_t)algorithm)) return sides;
    *n = 1;
    return one;
}

RT_API size_t rt_gpu_widths(rt_algorithm algorithm, int *widths, size_t max)
{
    size_t n, i;
    const int *list;
    if ((unsigned)algorithm >= RT_ALGORITHM_COUNT || algorithm == RT_AUTO) return 0;
    list = rti_gpu_width_list(algorithm, &n);
    for (i = 0; i < n && i < max; i++) widths[i] = list[i];
    return n;
}

/* What a general program does for: another algorithm of its structure, or the first of those that one program is for. */
static void rti_gpu_generalise(rti_gpu_key *key)
{
    key->general = 1;
    if (key->algorithm >= RT_KD_STACK && key->algorithm <= RT_KD_BACKTRACK) {
        key->algorithm = RT_KD_SHORTSTACK;
        key->entries = RT_MAX_SHORT_STACK;
    } else if (rti_gpu_is_large(key->algorithm)) {
        key->algorithm = RT_BVH_MASKED;
        key->cull = RT_CULL_NONE;
    } else if (key->algorithm == RT_BVH_SIMD) key->algorithm = RT_BVH_STACK;
    else if (key->algorithm == RT_THREADED_PARALLEL) key->algorithm = RT_THREADED_SINGLE;
}

/* Compiled, unless it has been. */
static rt_status rti_gpu_find_program(rt_gpu *gpu, const rti_gpu_key *key, rti_gpu_program **out, rt_error *error)
{
    rti_gpu_program *program = gpu->programs;
    while (program && memcmp(&program->key, key, sizeof *key)) program = program->next;
    *out = program;
    return program ? RT_OK : rti_gpu_compile(gpu, key, out, error);
}

/* A large packet is a work-group: of more rays a work-item where there are few in one, or the compiled kernel has room for few. */
static rt_status rti_gpu_fit_large(rt_gpu *gpu, rti_gpu_key *key, rti_gpu_task *task, rt_error *error)
{
    const uint32_t rays = task->side * task->side, fixed = 8 * key->levels[0].depth + 1536;    /* of the stack, and more than the frustum and so on */
    const bool shares = rti_gpu_shares(gpu, key);
    size_t group = gpu->group, bytes = 0;
    for (key->width = gpu->info.gpu ? 1 : 8; key->width <= 16; key->width *= key->width == 1 ? 4 : 2) {
        rt_status status;
        task->items = rays / key->width;
        task->rows = shares ? rti_gpu_rows(gpu) * rays : rti_gpu_culls(key) ? 8 * task->items : 1;
        task->numbers = shares ? 3 * task->items : 1;
        bytes = 4 * (size_t)task->rows + 2 * (size_t)task->numbers + fixed;
        if (task->items > gpu->group || bytes > gpu->local) continue;
        if ((status = rti_gpu_find_program(gpu, key, &task->program, error)) != RT_OK) return status;
        if (task->program->group) group = task->program->group;
        if (task->items <= group) return RT_OK;
    }
    return rti_fail(error, RT_ERROR_UNSUPPORTED, RT_NONE, "%ux%u rays take %u work-items and %u bytes of local memory; device %.64s has %u and %u together%s",
                    (unsigned)task->side, (unsigned)task->side, (unsigned)task->items, (unsigned)bytes, gpu->info.name, (unsigned)group,
                    (unsigned)gpu->local, task->side > 4 ? ": a smaller packet_width may do" : "");
}

/* From options to what a program for them is compiled for. */
static rt_status rti_gpu_resolve(const rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, rti_gpu_task *task, rti_gpu_key *key)
{
    rt_algorithm algorithm = opt->algorithm;
    const int *widths;
    int width = opt->packet_width;
    size_t n, i;
    rt_status status;
    if (!gpu || !accel) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", gpu ? "accel" : "gpu");
    if (accel->object.gpu != gpu) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "accel belongs to another context");
#if RTI_STATS
    if (opt->stats) return rti_fail(opt->error, RT_ERROR_UNSUPPORTED, RT_NONE, "kernels do not count: stats must be NULL");
#endif
    if ((status = rti_check_options(opt, accel->structure, accel->parts)) != RT_OK) return status;
    if (algorithm == RT_AUTO) {
        if (accel->structure == RT_BVH) algorithm = gpu->info.gpu ? RT_BVH_WIDE : RT_BVH_SIMD;
        else algorithm = accel->structure == RT_KDTREE ? RT_KD_STACK : RT_THREADED_SINGLE;
        width = 0;
    }
    widths = rti_gpu_width_list(algorithm, &n);
    if (!width) width = widths[rti_gpu_is_large((uint32_t)algorithm) ? 1 : n > 1 && !gpu->info.gpu ? 2 : 0];
    for (i = 0; i < n && widths[i] != width; i++) {}
    if (i == n) return rti_no_width(opt, widths, n);
    memset(key, 0, sizeof *key);
    key->algorithm = (uint32_t)algorithm;
    key->query = (uint32_t)opt->query;
    task->side = rti_gpu_is_large(key->algorithm) ? (uint32_t)width : 0;
    key->width = (uint32_t)(width == 2 && algorithm != RT_THREADED_PARALLEL ? 4 : width);
    key->entries = algorithm != RT_KD_SHORTSTACK ? 0 : opt->short_stack ? (uint32_t)opt->short_stack : 3;
    if (task->side) key->cull = (uint32_t)opt->cull;
    task->algorithm = (int32_t)key->algorithm;
    task->entries = (int32_t)key->entries;
    task->cull = (int32_t)key->cull;
    if (gpu->general) rti_gpu_generalise(key);
    rti_gpu_set_levels(gpu, accel, key);
    return RT_OK;
}

/* From options to the program that does it. */
static rt_status rti_gpu_choose_program(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, rti_gpu_task *task)
{
    rti_gpu_key key;
    const rt_status status = rti_gpu_resolve(gpu, accel, opt, task, &key);
    if (status != RT_OK) return status;
    return task->side ? rti_gpu_fit_large(gpu, &key, task, opt->error) : rti_gpu_find_program(gpu, &key, &task->program, opt->error);
}

typedef struct { size_t size; const void *value; } rti_gpu_argument;

/* Runs a kernel for so many work-items or more, in groups. */
static rt_status rti_gpu_run(const rt_gpu *gpu, rti_cl kernel, const rti_gpu_argument *arguments, size_t count, size_t items, size_t group,
                             rti_cl *event, const char *what, rt_error *error)
{
    const size_t all = (items + group - 1) / group * group;
    rti_cl_int code = RTI_CL_SUCCESS;
    size_t i;
    for (i = 0; i < count && code == RTI_CL_SUCCESS; i++)
        code = gpu->cl.SetKernelArg(kernel, (rti_cl_uint)i, arguments[i].size, arguments[i].value);
    if (code == RTI_CL_SUCCESS) code = gpu->cl.EnqueueNDRangeKernel(gpu->queue, kernel, 1, NULL, &all, &group, 0, NULL, event);
    return code == RTI_CL_SUCCESS ? RT_OK : rti_cl_fail(error, code, what);
}

RT_API rt_status rt_gpu_prepare(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt)
{
    rt_trace_options defaults;
    rti_gpu_task task;
    memset(&defaults, 0, sizeof defaults);
    return rti_gpu_choose_program(gpu, accel, opt ? opt : &defaults, &task);
}

RT_API rt_status rt_gpu_get_kernel(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, rt_gpu_kernel *kernel)
{
    rt_trace_options defaults;
    const rti_gpu_program *program;
    rti_gpu_task task;
    rti_cl_int code;
    rt_status status;
    memset(&defaults, 0, sizeof defaults);
    if (!opt) opt = &defaults;
    if (!kernel) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "kernel is NULL");
    memset(kernel, 0, sizeof *kernel);
    if ((status = rti_gpu_choose_program(gpu, accel, opt, &task)) != RT_OK) return status;
    program = task.program;
    kernel->algorithm = (rt_algorithm)task.algorithm;
    kernel->packet_width = (int)program->key.width;
    if (program->key.width == 4 && kernel->algorithm != RT_THREADED_PARALLEL) kernel->packet_width = 2;    /* 2x2 */
    if (task.side) kernel->packet_width = (int)task.side;
    if (task.side) {                        /* local memory counts once its size is given */
        code = gpu->cl.SetKernelArg(program->kernels[0], 8, sizeof(float) * task.rows, NULL);
        if (code == RTI_CL_SUCCESS) code = gpu->cl.SetKernelArg(program->kernels[0], 9, sizeof(uint16_t) * task.numbers, NULL);
        if (code != RTI_CL_SUCCESS) return rti_cl_fail(opt->error, code, "a kernel");
    }
    kernel->private_bytes = rti_gpu_kernel_number(gpu, program->kernels[0], RTI_CL_PRIVATE_SIZE);
    kernel->local_bytes = rti_gpu_kernel_number(gpu, program->kernels[0], RTI_CL_LOCAL_SIZE);
    kernel->group = program->group;
    return RT_OK;
}

static rt_status rti_gpu_launch(const rt_gpu *gpu, const rti_gpu_task *task, const rt_gpu_accel *accel, const rti_cl buffers[3], size_t first,
                                size_t count, rti_cl *event, rt_error *error)
{
    const rti_gpu_program *program = task->program;
    const bool large = task->side != 0;
    const uint64_t base = first, number = count;
    const rti_gpu_argument arguments[] = {
        { sizeof(rti_cl), &accel->object.mem }, { sizeof(rti_cl), &buffers[0] }, { sizeof(rti_cl), &buffers[1] }, { sizeof(rti_cl), &buffers[2] },
        { sizeof base, &base }, { sizeof number, &number }, { sizeof task->algorithm, &task->algorithm },
        { sizeof(int32_t), large ? &task->cull : &task->entries },
        { sizeof(float) * task->rows, NULL }, { sizeof(uint16_t) * task->numbers, NULL }            /* of large packets: local memory */
    };
    const size_t items = (count + program->key.width - 1) / program->key.width;
    const rt_status status = rti_gpu_run(gpu, program->kernels[0], arguments, large ? 10 : 8, items, large ? task->items : 64, event,
                                         "tracing rays", error);
    return status == RT_OK && gpu->cl.Flush(gpu->queue) != RTI_CL_SUCCESS ? rti_cl_fail(error, RTI_CL_NO_RESOURCES, "tracing rays") : status;
}

static rt_status rti_gpu_needs(const rt_gpu *gpu, const rt_gpu_buffer *buffer, size_t count, size_t size, const char *name, rt_error *error)
{
    if (!buffer) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", name);
    if (buffer->object.gpu != gpu) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s belongs to another context", name);
    if (count > buffer->object.bytes / size)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s has %lu bytes; %lu rays need %lu each", name, (unsigned long)buffer->object.bytes,
                        (unsigned long)count, (unsigned long)size);
    return RT_OK;
}

RT_API rt_status rt_gpu_trace_buffers(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, const rt_gpu_buffer *rays,
                                      const rt_gpu_buffer *times, size_t count, rt_gpu_buffer *hits, rt_gpu_event **event)
{
    rt_trace_options defaults;
    rti_gpu_object *object = NULL;
    rti_gpu_task task;
    rti_cl buffers[3], done = NULL;
    rt_status status;
    memset(&defaults, 0, sizeof defaults);
    if (!opt) opt = &defaults;
    if (event) *event = NULL;
    if ((status = rti_gpu_choose_program(gpu, accel, opt, &task)) != RT_OK) return status;
    if (opt->times) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "opt->times is memory of the host: times must be a buffer");
    if (!count) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "no rays");
    if ((status = rti_gpu_needs(gpu, rays, count, sizeof(rt_ray), "rays", opt->error)) != RT_OK) return status;
    if ((status = rti_gpu_needs(gpu, hits, count, sizeof(rt_hit), "hits", opt->error)) != RT_OK) return status;
    if (times && (status = rti_gpu_needs(gpu, times, count, sizeof(float), "times", opt->error)) != RT_OK) return status;
    if (event && (status = rti_gpu_make(gpu, sizeof **event, 0, 0, &object, "an event", opt->error)) != RT_OK) return status;
    buffers[0] = rays->object.mem;
    buffers[1] = hits->object.mem;
    buffers[2] = times ? times->object.mem : NULL;
    status = rti_gpu_launch(gpu, &task, accel, buffers, 0, count, event ? &done : NULL, opt->error);
    if (!event) return status;
    if (status != RT_OK) {
        rti_gpu_drop(object);
        return status;
    }
    object->event = true;
    object->mem = done;
    *event = (rt_gpu_event *)(void *)object;
    return RT_OK;
}

RT_API rt_status rt_gpu_wait(rt_gpu_event *event, double *seconds, rt_error *error)
{
    uint64_t start = 0, end = 0;
    rti_cl_int code;
    rt_gpu *gpu;
    if (seconds) *seconds = 0;
    if (!event) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "event is NULL");
    gpu = event->object.gpu;
    code = gpu->cl.WaitForEvents(1, &event->object.mem);
    if (code == RTI_CL_SUCCESS && seconds) {
        code = gpu->cl.GetEventProfilingInfo(event->object.mem, RTI_CL_PROFILE_START, sizeof start, &start, NULL);
        if (code == RTI_CL_SUCCESS) code = gpu->cl.GetEventProfilingInfo(event->object.mem, RTI_CL_PROFILE_END, sizeof end, &end, NULL);
        if (code == RTI_CL_SUCCESS) *seconds = 1e-9 * (double)(end - start);
    }
    rti_gpu_drop(&event->object);
    return code == RTI_CL_SUCCESS ? RT_OK : rti_cl_fail(error, code, "waiting for the device");
}

RT_API bool rt_gpu_done(const rt_gpu_event *event)
{
    rti_cl_int state = 1;
    const rti_cl_int code = event->object.gpu->cl.GetEventInfo(event->object.mem, RTI_CL_EVENT_STATUS, sizeof state, &state, NULL);
    return code != RTI_CL_SUCCESS || state <= 0;
}

RT_API rt_status rt_gpu_finish(rt_gpu *gpu, rt_error *error)
{
    rti_cl_int code;
    if (!gpu) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "gpu is NULL");
    code = gpu->cl.Finish(gpu->queue);
    return code == RTI_CL_SUCCESS ? RT_OK : rti_cl_fail(error, code, "waiting for the device");
}

#define RTI_GPU_BATCH ((size_t)1 << 20)     /* rays that are copied at a time */

RT_API rt_status rt_gpu_trace(rt_gpu *gpu, const rt_gpu_accel *accel, const rt_trace_options *opt, const rt_ray *rays, size_t count,
                              rt_hit *hits)
{
    rt_trace_options defaults;
    rti_gpu_task task;
    size_t first, batch = count < RTI_GPU_BATCH ? count : RTI_GPU_BATCH;
    rt_status status;
    memset(&defaults, 0, sizeof defaults);
    if (!opt) opt = &defaults;
    if (count > SIZE_MAX / 2 / sizeof(rt_ray)) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "count is negative, or too large");
    if (count && (!rays || !hits)) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", rays ? "hits" : "rays");
    if ((status = rti_gpu_choose_program(gpu, accel, opt, &task)) != RT_OK || !count) return status;
    if ((status = rti_gpu_stage(gpu, &gpu->rays, batch * sizeof *rays, opt->error)) != RT_OK) return status;
    if ((status = rti_gpu_stage(gpu, &gpu->hits, batch * sizeof *hits, opt->error)) != RT_OK) return status;
    if (opt->times && (status = rti_gpu_stage(gpu, &gpu->times, batch * sizeof(float), opt->error)) != RT_OK) return status;
    for (first = 0; first < count && status == RT_OK; first += batch) {
        const size_t n = count - first < batch ? count - first : batch;
        rti_cl buffers[3];
        buffers[0] = gpu->rays->object.mem;
        buffers[1] = gpu->hits->object.mem;
        buffers[2] = opt->times ? gpu->times->object.mem : NULL;
        status = rt_gpu_write(gpu->rays, 0, rays + first, n * sizeof *rays, opt->error);
        if (status == RT_OK && opt->times) status = rt_gpu_write(gpu->times, 0, opt->times + first, n * sizeof(float), opt->error);
        if (status == RT_OK) status = rti_gpu_launch(gpu, &task, accel, buffers, 0, n, NULL, opt->error);
        if (status == RT_OK) status = rt_gpu_read(gpu->hits, 0, hits + first, n * sizeof *hits, opt->error);
    }
    return status;
}

/* ---- >>gpu-render --------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

struct rt_gpu_scene {
    rti_gpu_object object;                  /* an rti_gpu_shape a part, then the arrays that they tell of */
    rt_gpu_accel *accel;
    rt_camera camera;
    rt_vec3 ambient, background;
    uint32_t lights, light_count;           /* lights: where they are, in units of RTI_GPU_ALIGN */
    uint32_t light_pairs;                   /* see rti_light_pairs of rt.h */
    uint32_t shows;                         /* bits by rti_gpu_things */
    bool moves, shiny;                      /* shiny: something mirrors or refracts */
    size_t triangles, spheres, instances;   /* of the outermost, for rasters */
};

/* Arrays of a scene are copied as they are, or put together of things that have pointers; textures follow their materials. */
typedef enum { RTI_GPU_AS_IT_IS, RTI_GPU_MATERIALS, RTI_GPU_LIGHTS, RTI_GPU_PARTS, RTI_GPU_CONTENTS } rti_gpu_content;

/* Those of one content, each once: as long as the longest that begins there. */
typedef struct { size_t count, bytes; uint32_t at; } rti_gpu_blob;
typedef struct { rti_gpu_names names; rti_gpu_blob *blobs; size_t space; } rti_gpu_arrays;

typedef struct {
    rt_gpu *gpu;
    rti_gpu_names scenes;
    rti_gpu_arrays arrays[RTI_GPU_CONTENTS];
    uint32_t shows;                         /* bits by rti_gpu_things */
    bool shiny;                             /* something mirrors or refracts */
} rti_gpu_album;

static size_t rti_gpu_max_index(const uint32_t *indices, size_t triangles)
{
    size_t i, most = 0;
    for (i = 0; i < 3 * triangles; i++)
        if (indices[i - i % 3] != RT_NONE && indices[i] + (size_t)1 > most) most = indices[i] + (size_t)1;
    return most;
}

static rt_status rti_gpu_no_memory(rt_error *error) { return rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "no memory to copy a scene"); }

/* All scenes below, each once. */
static rt_status rti_gpu_collect_scenes(rti_gpu_album *a, const rt_scene *root, rt_error *error)
{
    uint32_t number;
    size_t done, i;
    if (!rti_gpu_add(&a->scenes, root, &number)) return rti_gpu_no_memory(error);
    for (done = 0; done < a->scenes.count; done++) {
        const rt_scene *scene = (const rt_scene *)a->scenes.things[done];
        const rt_status status = rti_scene_lacks(scene, error);
        if (status != RT_OK) return status;
        for (i = 0; i < rti_instance_count(scene->geometry); i++) {
            if (!scene->parts[i]) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "instance %lu: its part is missing", (unsigned long)i);
            if (!rti_gpu_add(&a->scenes, scene->parts[i], &number)) return rti_gpu_no_memory(error);
        }
    }
    return RT_OK;
}

/* Notes an array; *more: it is new, or longer than it was. False: no memory. */
static bool rti_gpu_add_array(rti_gpu_album *a, rti_gpu_content content, const void *array, size_t count, size_t size, bool *more)
{
    rti_gpu_arrays *list = &a->arrays[content];
    uint32_t number;
    *more = false;
    if (!array || !count) return true;
    if (list->names.count == list->space) {
        const size_t space = list->space ? 2 * list->space : 16;
        rti_gpu_blob *blobs = (rti_gpu_blob *)rti_alloc(space, sizeof *blobs, a->gpu->memory_user);
        if (!blobs) return false;
        memset(blobs, 0, space * sizeof *blobs);
        if (list->space) memcpy(blobs, list->blobs, list->space * sizeof *blobs);
        rti_release(list->blobs, a->gpu->memory_user);
        list->blobs = blobs;
        list->space = space;
    }
    if (!rti_gpu_add(&list->names, array, &number)) return false;
    if (count > list->blobs[number].count) {
        list->blobs[number].count = count;
        *more = true;
    }
    if (count * size > list->blobs[number].bytes) list->blobs[number].bytes = count * size;
    return true;
}

static bool rti_gpu_add_floats(rti_gpu_album *a, const void *array, size_t count)
{
    bool more;
    return rti_gpu_add_array(a, RTI_GPU_AS_IT_IS, array, count, sizeof(float), &more);
}

static bool rti_gpu_add_texture(rti_gpu_album *a, const rt_texture *texture)
{
    if (!texture) return true;
    a->shows |= RTI_GPU_SHOWS_TEXTURES;
    if (texture->kind != RT_TEXTURE_IMAGE) return true;
    return rti_gpu_add_floats(a, texture->levels, 3 * rt_count_texture_levels(texture->width, texture->height));
}

static bool rti_gpu_add_materials(rti_gpu_album *a, const rt_material *materials, size_t count)
{
    size_t i;
    bool more, good = rti_gpu_add_array(a, RTI_GPU_MATERIALS, materials, count, sizeof(rti_gpu_material) + 2 * sizeof(rti_gpu_texture), &more);
    for (i = 0; good && more && i < count; i++) {
        const rt_material *m = &materials[i];
        if (rti_any(m->transmit)) a->shows |= RTI_GPU_SHOWS_GLASS;
#if RTI_SAMPLING
        if (m->roughness > 0) a->shows |= RTI_GPU_SHOWS_ROUGHNESS;
#endif
        a->shiny |= rti_any(m->reflect) || rti_any(m->transmit);
        good = rti_gpu_add_texture(a, m->texture) && rti_gpu_add_texture(a, m->bump);
    }
    return good;
}

static bool rti_gpu_add_arrays(rti_gpu_album *a, const rt_scene *scene)
{
    const rt_geometry *geo = scene->geometry;
    const rti_shape shape = rti_shape_of(scene);
    const size_t triangles = geo->triangle_count;
    bool more, good = rti_gpu_add_floats(a, shape.vertices, geo->vertex_count ? (geo->vertex_count - 1) * shape.stride + 3 : 0);
    good = good && rti_gpu_add_floats(a, shape.indices, 3 * triangles);
    good = good && rti_gpu_add_floats(a, shape.colors, 3 * geo->vertex_count);
    good = good && rti_gpu_add_floats(a, shape.material_ids, triangles + rti_sphere_count(geo) + rti_plane_count(geo));
    if (shape.normals) {
        good = good && rti_gpu_add_floats(a, shape.normals, 3 * rti_gpu_max_index(shape.normal_indices, triangles));
        good = good && rti_gpu_add_floats(a, shape.normal_indices, 3 * triangles);
    }
    if (shape.texcoords) {
        good = good && rti_gpu_add_floats(a, shape.texcoords, 2 * rti_gpu_max_index(shape.texcoord_indices, triangles));
        good = good && rti_gpu_add_floats(a, shape.texcoord_indices, 3 * triangles);
    }
#if RTI_SPHERES
    good = good && rti_gpu_add_array(a, RTI_GPU_AS_IT_IS, geo->spheres, geo->sphere_count, sizeof *geo->spheres, &more);
#endif
#if RTI_PLANES
    good = good && rti_gpu_add_array(a, RTI_GPU_AS_IT_IS, geo->planes, geo->plane_count, sizeof *geo->planes, &more);
#endif
    if (rti_sphere_count(geo) || rti_plane_count(geo)) a->shows |= RTI_GPU_SHOWS_SHAPES;
    if (rti_instance_count(geo)) a->shows |= RTI_GPU_SHOWS_INSTANCES;
    good = good && rti_gpu_add_array(a, RTI_GPU_PARTS, scene->parts, rti_instance_count(geo), sizeof(int64_t), &more);
    return good && rti_gpu_add_materials(a, shape.materials, scene->material_count ? scene->material_count : 1);
}

/* Bytes from the arena's start; 0: there is no such array. */
static int64_t rti_gpu_where(const rti_gpu_album *a, rti_gpu_content content, const void *array)
{
    const rti_gpu_arrays *list = &a->arrays[content];
    const size_t at = array && list->names.count ? list->names.table[rti_gpu_place(&list->names, array)] : 0;
    return at ? (int64_t)list->blobs[at - 1].at * RTI_GPU_ALIGN : 0;
}

/* Bytes from there to an array that is copied as it is; 0: there is none. */
static int64_t rti_gpu_distance(const rti_gpu_album *a, const void *array, int64_t from)
{
    const int64_t at = rti_gpu_where(a, RTI_GPU_AS_IT_IS, array);
    return at ? at - from : 0;
}

static void rti_gpu_write_shape(const rti_gpu_album *a, const rt_scene *scene, int64_t from, rti_gpu_shape *to)
{
    const rti_shape shape = rti_shape_of(scene);
    memset(to, 0, sizeof *to);
    to->vertices = rti_gpu_distance(a, shape.vertices, from);
    to->indices = rti_gpu_distance(a, shape.indices, from);
    to->normals = rti_gpu_distance(a, shape.normals, from);
    to->normal_indices = to->normals ? rti_gpu_distance(a, shape.normal_indices, from) : 0;
    to->colors = rti_gpu_distance(a, shape.colors, from);
    to->texcoords = rti_gpu_distance(a, shape.texcoords, from);
    to->texcoord_indices = to->texcoords ? rti_gpu_distance(a, shape.texcoord_indices, from) : 0;
    to->materials = rti_gpu_where(a, RTI_GPU_MATERIALS, shape.materials) - from;       /* there are always some */
    to->material_ids = rti_gpu_distance(a, shape.material_ids, from);
#if RTI_SPHERES
    to->spheres = rti_gpu_distance(a, shape.spheres, from);
#endif
#if RTI_PLANES
    to->planes = rti_gpu_distance(a, shape.planes, from);
#endif
    if (shape.instance_count) to->parts = rti_gpu_where(a, RTI_GPU_PARTS, scene->parts) - from;
    to->stride = (uint32_t)shape.stride;
    to->triangle_count = shape.triangle_count;
    to->instance_count = shape.instance_count;
    to->tree_count = shape.tree_count;
}

/* Writes what a material's texture is, if there is one, and answers how far from the material it is. */
static int64_t rti_gpu_write_texture(const rti_gpu_album *a, const rt_texture *texture, int64_t start, int64_t from, int64_t at, char *staged)
{
    rti_gpu_texture *to = (rti_gpu_texture *)(void *)(staged + at);
    memset(to, 0, sizeof *to);
    if (!texture) return 0;
    if (texture->kind == RT_TEXTURE_IMAGE) to->levels = rti_gpu_distance(a, texture->levels, start + at);
    to->kind = (uint32_t)texture->kind;
    to->solid = texture->solid;
    to->width = texture->width;
    to->height = texture->height;
    to->colors[0] = texture->colors[0];
    to->colors[1] = texture->colors[1];
    to->size = texture->size;
    return at - from;
}

static void rti_gpu_write_materials(const rti_gpu_album *a, const rt_material *materials, size_t count, int64_t start, char *staged)
{
    size_t i;
    for (i = 0; i < count; i++) {
        const rt_material *m = &materials[i];
        const int64_t from = (int64_t)(i * sizeof(rti_gpu_material));
        const int64_t at = (int64_t)(count * sizeof(rti_gpu_material) + 2 * i * sizeof(rti_gpu_texture));
        rti_gpu_material *to = (rti_gpu_material *)(void *)(staged + from);
        memset(to, 0, sizeof *to);
        to->texture = rti_gpu_write_texture(a, m->texture, start, from, at, staged);
        to->bump = rti_gpu_write_texture(a, m->bump, start, from, at + (int64_t)sizeof(rti_gpu_texture), staged);
        to->diffuse = m->diffuse;
        to->specular = m->specular;
        to->emission = m->emission;
        to->reflect = m->reflect;
        to->transmit = m->transmit;
        to->absorb = m->absorb;
        to->shininess = m->shininess;
        to->ior = m->ior;
#if RTI_SAMPLING
        to->roughness = m->roughness;
#endif
        to->bump_height = m->bump_height;
        to->fresnel = m->fresnel;
    }
}

static void rti_gpu_write_lights(const rt_light *lights, size_t count, rti_gpu_light *to)
{
    size_t i;
    memset(to, 0, count * sizeof *to);
    for (i = 0; i < count; i++) {
        to[i].position = lights[i].position;
        to[i].color = lights[i].color;
#if RTI_SAMPLING
        to[i].edges[0] = lights[i].edges[0];
        to[i].edges[1] = lights[i].edges[1];
        to[i].radius = lights[i].radius;
        to[i].by_area = lights[i].by_area;
#endif
    }
}

/* Places all arrays behind the shapes; answers how many units of RTI_GPU_ALIGN all take. */
static uint64_t rti_gpu_lay_out(rti_gpu_album *a)
{
    uint64_t units = (a->scenes.count * sizeof(rti_gpu_shape) + RTI_GPU_ALIGN - 1) / RTI_GPU_ALIGN;
    size_t i;
    int content;
    for (content = 0; content < RTI_GPU_CONTENTS; content++)
        for (i = 0; i < a->arrays[content].names.count; i++) {
            rti_gpu_blob *blob = &a->arrays[content].blobs[i];
            blob->at = (uint32_t)units;
            units += (blob->bytes + RTI_GPU_ALIGN - 1) / RTI_GPU_ALIGN;
        }
    return units;
}

/* How far the parts of an array are from where they are told. */
static void rti_gpu_write_parts(const rti_gpu_album *a, const rt_scene *const *parts, size_t count, int64_t start, int64_t *to)
{
    size_t i;
    for (i = 0; i < count; i++)
        to[i] = (int64_t)(rti_gpu_number_of(&a->scenes, parts[i]) * sizeof(rti_gpu_shape)) - (start + (int64_t)(i * sizeof *to));
}

static rt_status rti_gpu_send_array(const rti_gpu_album *a, rt_gpu_scene *there, rti_gpu_content content, size_t number, rt_error *error)
{
    const rti_gpu_blob *blob = &a->arrays[content].blobs[number];
    const void *const array = a->arrays[content].names.things[number], *from = array;
    const int64_t start = (int64_t)blob->at * RTI_GPU_ALIGN;
    char *staged = NULL;
    rt_status status;
    if (content != RTI_GPU_AS_IT_IS) {
        from = staged = (char *)rti_alloc(blob->bytes, 1, a->gpu->memory_user);
        if (!staged) return rti_gpu_no_memory(error);
    }
    if (content == RTI_GPU_MATERIALS) rti_gpu_write_materials(a, (const rt_material *)array, blob->count, start, staged);
    if (content == RTI_GPU_LIGHTS) rti_gpu_write_lights((const rt_light *)array, blob->count, (rti_gpu_light *)(void *)staged);
    if (content == RTI_GPU_PARTS) rti_gpu_write_parts(a, (const rt_scene *const *)array, blob->count, start, (int64_t *)(void *)staged);
    status = rti_gpu_send(&there->object, (size_t)start, from, blob->bytes, "copying a scene", error);
    rti_release(staged, a->gpu->memory_user);
    return status;
}

static rt_status rti_gpu_send_scene(const rti_gpu_album *a, rt_gpu_scene *there, rt_error *error)
{
    const size_t bytes = a->scenes.count * sizeof(rti_gpu_shape);
    rti_gpu_shape *shapes = (rti_gpu_shape *)rti_alloc(bytes, 1, a->gpu->memory_user);
    rt_status status;
    size_t i;
    int content;
    if (!shapes) return rti_gpu_no_memory(error);
    for (i = 0; i < a->scenes.count; i++)
        rti_gpu_write_shape(a, (const rt_scene *)a->scenes.things[i], (int64_t)(i * sizeof *shapes), &shapes[i]);
    status = rti_gpu_send(&there->object, 0, shapes, bytes, "copying a scene", error);
    rti_release(shapes, a->gpu->memory_user);
    for (content = 0; content < RTI_GPU_CONTENTS; content++)
        for (i = 0; i < a->arrays[content].names.count && status == RT_OK; i++)
            status = rti_gpu_send_array(a, there, (rti_gpu_content)content, i, error);
    return status;
}

/* What is the same for all pictures of a scene. */
static void rti_gpu_describe_scene(const rti_gpu_album *a, const rt_scene *scene, rt_gpu_scene *there)
{
    there->shows = a->shows;
    there->shiny = a->shiny;
#if RTI_SAMPLING
    there->light_pairs = rti_light_pairs(scene->lights, scene->light_count);
    if (there->light_pairs) there->shows |= RTI_GPU_SHOWS_LAMPS;
    there->moves = rti_moves(scene->accel);
#endif
    there->camera = scene->camera;
    there->ambient = scene->ambient;
    there->background = scene->background;
    there->lights = (uint32_t)(rti_gpu_where(a, RTI_GPU_LIGHTS, scene->lights) / RTI_GPU_ALIGN);
    there->light_count = (uint32_t)scene->light_count;
    there->triangles = scene->geometry->triangle_count;
    there->spheres = rti_sphere_count(scene->geometry);
    there->instances = rti_instance_count(scene->geometry);
}

static void rti_gpu_close_album(rti_gpu_album *a)
{
    int content;
    rti_gpu_forget(&a->scenes);
    for (content = 0; content < RTI_GPU_CONTENTS; content++) {
        rti_gpu_forget(&a->arrays[content].names);
        rti_release(a->arrays[content].blobs, a->gpu->memory_user);
    }
}

RT_API rt_status rt_gpu_upload_scene(rt_gpu *gpu, rt_gpu_scene **out, const rt_scene *scene, rt_error *error)
{
    rti_gpu_album a;
    rti_gpu_object *object = NULL;
    rt_gpu_accel *accel = NULL;
    rt_status status;
    uint64_t units;
    size_t i;
    bool more, good;
    if (!gpu || !out || !scene) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", !gpu ? "gpu" : out ? "scene" : "out");
    *out = NULL;
    memset(&a, 0, sizeof a);
    a.gpu = gpu;
    a.scenes.user = gpu->memory_user;
    for (i = 0; i < RTI_GPU_CONTENTS; i++) a.arrays[i].names.user = gpu->memory_user;
    status = rti_gpu_collect_scenes(&a, scene, error);
    if (status == RT_OK) {
        good = rti_gpu_add_array(&a, RTI_GPU_LIGHTS, scene->lights, scene->light_count, sizeof(rti_gpu_light), &more);
        for (i = 0; i < a.scenes.count && good; i++) good = rti_gpu_add_arrays(&a, (const rt_scene *)a.scenes.things[i]);
        if (!good) status = rti_gpu_no_memory(error);
    }
    units = rti_gpu_lay_out(&a);
    if (status == RT_OK && units > 0x3fffffffu) status = rti_fail(error, RT_ERROR_LIMIT, RT_NONE, "a scene of more than 64 GB");
    if (status == RT_OK) status = rt_gpu_upload(gpu, &accel, scene->accel, error);
    if (status == RT_OK) {
        rti_gpu_give_way(gpu, (size_t)units * RTI_GPU_ALIGN);
        status = rti_gpu_make(gpu, sizeof **out, (size_t)units * RTI_GPU_ALIGN, RTI_CL_READ_ONLY, &object, "a scene", error);
    }
    if (status == RT_OK) {
        rt_gpu_scene *there = (rt_gpu_scene *)(void *)object;
        there->accel = accel;
        rti_gpu_describe_scene(&a, scene, there);
        status = rti_gpu_send_scene(&a, there, error);
        if (status == RT_OK) *out = there;
        else rti_gpu_drop(object);
    }
    if (status != RT_OK) rt_gpu_free(accel);
    rti_gpu_close_album(&a);
    return status;
}

RT_API void rt_gpu_free_scene(rt_gpu_scene *scene)
{
    if (!scene) return;
    rt_gpu_free(scene->accel);
    rti_gpu_drop(&scene->object);
}

RT_API void rt_gpu_set_camera(rt_gpu_scene *scene, const rt_camera *camera) { scene->camera = *camera; }
RT_API size_t rt_gpu_scene_bytes(const rt_gpu_scene *scene) { return scene->object.bytes + scene->accel->object.bytes; }

/* ---- pictures */

/* One call of rt_gpu_render_tile. */
typedef struct {
    rt_gpu *gpu;
    const rt_gpu_scene *scene;
    rti_gpu_frame frame;
    rti_gpu_program *steps;
    rti_gpu_task closest, any, cover;
    rti_gpu_object *raster;                 /* NULL: eye rays are traced */
    rti_cl buffers[3];                      /* rays, hits, times */
    int spp, first, samples;                /* samples first to first + samples - 1 of spp */
    const uint32_t *counts;                 /* of opt */
    rt_ray_counts rays;
    rti_gpu_pixel *pixels;                  /* of a tile, as read back */
    rt_error *error;
} rti_gpu_picture;

static bool rti_gpu_raster_fits(const rt_raster *r, const rt_gpu_scene *scene, const rt_render_options *opt)
{
    rt_geometry geo;
    memset(&geo, 0, sizeof geo);
    geo.triangle_count = scene->triangles;
#if RTI_SPHERES
    geo.sphere_count = scene->spheres;
#endif
#if RTI_INSTANCES
    geo.instance_count = scene->instances;
#endif
    return rti_raster_fits(r, &geo, &scene->camera, opt->width, opt->height);
}

/* The device's copies of both. */
typedef char rti_check_raster_span[sizeof(rti_gpu_span) == sizeof(rti_span) ? 1 : -1];
typedef char rti_check_raster_levels[RTI_MAX_LEVELS == 17 ? 1 : -1];

static void rti_gpu_write_raster(const rt_raster *raster, const rt_gpu_scene *scene, const size_t at[5], rti_gpu_raster *head)
{
    int i;
    memset(head, 0, sizeof *head);
    head->level_count = (uint32_t)raster->level_count;
    for (i = 0; i < raster->level_count; i++) {
        head->shifts[i] = (uint32_t)raster->levels[i].shift;
        head->columns[i] = (uint32_t)raster->levels[i].columns;
        head->firsts[i] = raster->levels[i].first;
    }
    head->triangle_count = (uint32_t)scene->triangles;
    head->solid_count = (uint32_t)(scene->triangles + scene->spheres);
    head->spans = (uint32_t)at[1];
    head->starts = (uint32_t)at[2];
    head->entries = (uint32_t)at[3];
    head->slots = (uint32_t)at[4];
}

/* Copies what tiles list, and has the device find where that is in the accel. */
static rt_status rti_gpu_copy_raster(rti_gpu_picture *p, const rt_raster *raster)
{
    void *const user = p->gpu->memory_user;
    const rt_gpu_scene *scene = p->scene;
    const size_t prims = scene->triangles + scene->spheres + scene->instances;
    const size_t bytes[5] = { sizeof(rti_gpu_raster), prims * sizeof(rti_span), (raster->info.tiles + 1) * sizeof(uint32_t),
                              raster->info.entries * sizeof(uint32_t), prims * sizeof(uint32_t) };
    const void *from[5] = { NULL, raster->spans, raster->starts, raster->entries, NULL };
    rti_gpu_raster head;
    size_t at[5], units = 0, i;
    uint32_t *none;                         /* slots, before they are found */
    rt_status status;
    for (i = 0; i < 5; i++) {
        at[i] = units;
        units += (bytes[i] + RTI_GPU_ALIGN - 1) / RTI_GPU_ALIGN;
    }
    status = rti_gpu_make(p->gpu, sizeof *p->raster, units * RTI_GPU_ALIGN, RTI_CL_READ_WRITE, &p->raster, "a raster", p->error);
    if (status != RT_OK) return status;
    none = (uint32_t *)rti_alloc(prims ? prims : 1, sizeof *none, user);
    if (!none) return rti_fail(p->error, RT_ERROR_MEMORY, RT_NONE, "no memory to copy a raster");
    memset(none, 0xff, prims * sizeof *none);               /* RT_NONE */
    rti_gpu_write_raster(raster, scene, at, &head);
    from[0] = &head;
    from[4] = none;
    for (i = 0; i < 5 && status == RT_OK; i++)
        if (bytes[i]) status = rti_gpu_send(p->raster, at[i] * RTI_GPU_ALIGN, from[i], bytes[i], "copying a raster", p->error);
    rti_release(none, user);
    if (status == RT_OK && prims) {
        const rti_gpu_argument arguments[] = { { sizeof(rti_cl), &scene->accel->object.mem }, { sizeof(rti_cl), &p->raster->mem } };
        status = rti_gpu_run(p->gpu, p->cover.program->kernels[1], arguments, 2, prims, 64, NULL, "copying a raster", p->error);
    }
    return status;
}

/* Eye rays go in packets as those of RT_AUTO, and below instances as it does. */
static rt_status rti_gpu_choose_cover(rti_gpu_picture *p)
{
    rt_trace_options trace;
    rti_gpu_key key;
    rt_status status;
    memset(&trace, 0, sizeof trace);
    trace.error = p->error;
    if ((status = rti_gpu_resolve(p->gpu, p->scene->accel, &trace, &p->cover, &key)) != RT_OK) return status;
    key.kind = RTI_GPU_COVERS;
    key.levels[0].structures = 0;
    return rti_gpu_find_program(p->gpu, &key, &p->cover.program, p->error);
}

/* What holds for all tiles and samples. */
static void rti_gpu_set_frame(rti_gpu_picture *p, const rt_render_options *opt)
{
    const rt_gpu_scene *scene = p->scene;
    rti_gpu_frame *f = &p->frame;
    rti_film film;
    memset(&film, 0, sizeof film);
    film.view = rti_make_view(&scene->camera, opt->width, opt->height);
    f->view[0] = film.view.eye;
    f->view[1] = film.view.corner;
    f->view[2] = film.view.right;
    f->view[3] = film.view.down;
    f->ambient = scene->ambient;
    f->background = scene->background;
    f->angle = rti_angle_of(&film.view, p->spp);
    f->spp = (uint32_t)p->spp;
    f->depth = scene->shiny ? (uint32_t)rti_depth_of(opt) : 0;
    f->waiting = scene->shows & RTI_GPU_SHOWS_GLASS ? f->depth : 0;        /* what only mirrors sends one ray on */
    f->lights = scene->lights;
#if RTI_SAMPLING
    rti_set_distribution(&film, &scene->camera, scene->moves, opt, p->spp);
    f->light_pairs = scene->light_pairs;
    f->lens_right = film.lens.right;
    f->lens_down = film.lens.down;
    f->rfocus = film.lens.rfocus;
    f->open = film.open;
    f->length = film.length;
    f->seed = film.sampler.seed;
    f->frame = film.sampler.frame;
    f->sampler = (uint32_t)film.sampler.kind;
    f->filter = (uint32_t)film.filter;
    f->lens_open = film.lens.open;
    f->timed = film.timed;
    f->spread = film.spread;
#endif
}

static rt_status rti_gpu_find_programs(rti_gpu_picture *p, const rt_render_options *opt)
{
    const rti_gpu_frame *f = &p->frame;
    rt_trace_options trace = opt->trace;
    rti_gpu_key key;
    rt_status status;
    trace.query = RT_CLOSEST;
    if ((status = rti_gpu_choose_program(p->gpu, p->scene->accel, &trace, &p->closest)) != RT_OK) return status;
    trace.query = RT_ANY;
    if ((status = rti_gpu_choose_program(p->gpu, p->scene->accel, &trace, &p->any)) != RT_OK) return status;
    if (opt->raster && (status = rti_gpu_choose_cover(p)) != RT_OK) return status;
    memset(&key, 0, sizeof key);
    key.kind = RTI_GPU_FRAMES;
    key.width = 1;
    key.general = p->gpu->general;
    key.shows = p->gpu->general ? (uint32_t)RTI_GPU_SHOWS_ALL : p->scene->shows;
    if (!p->gpu->general) {
        key.sampler = f->sampler;
        key.filter = f->filter;
        key.lens_open = f->lens_open;
        key.timed = f->timed;
        key.spread = f->spread;
    }
    return rti_gpu_find_program(p->gpu, &key, &p->steps, p->error);
}

/* Bytes of a tile's memory beside rays, hits and times: rti_work. */
static size_t rti_gpu_work_bytes(const rti_gpu_frame *f)
{
    const size_t waiting = f->waiting * (sizeof(rt_ray) + sizeof(rti_gpu_path));
    return RTI_GPU_ALIGN + f->space * (sizeof(rti_gpu_pixel) + 2 * sizeof(rti_gpu_path) + RTI_GPU_SURFACE * sizeof(float) + waiting + sizeof(uint32_t));
}

/* Pixels of a tile at most: enough to keep the device busy, few enough that a CPU's caches hold some of it; and bytes. */
#define RTI_GPU_TILE(gpu) ((size_t)1 << ((gpu)->info.gpu ? 20 : 16))
#define RTI_GPU_TILE_BYTES ((size_t)1 << 29)

static rt_status rti_gpu_stage_tile(rt_gpu *gpu, const rti_gpu_frame *f, rt_error *error)
{
    rt_status status = rti_gpu_stage(gpu, &gpu->rays, f->space * sizeof(rt_ray), error);
    if (status == RT_OK) status = rti_gpu_stage(gpu, &gpu->hits, f->space * sizeof(rt_hit), error);
    if (status == RT_OK) status = rti_gpu_stage(gpu, &gpu->times, f->space * sizeof(float), error);
    return status == RT_OK ? rti_gpu_stage(gpu, &gpu->work, rti_gpu_work_bytes(f), error) : status;
}

/* Memory for tiles of at most that many pixels: fewer, where they would take more than half of what is left. */
static rt_status rti_gpu_make_room(rti_gpu_picture *p, size_t pixels)
{
    rt_gpu *gpu = p->gpu;
    rti_gpu_frame *f = &p->frame;
    size_t left = gpu->memory_limit - gpu->used, each, most;
    rt_status status;
    if (gpu->rays) left += gpu->rays->object.bytes;
    if (gpu->hits) left += gpu->hits->object.bytes;
    if (gpu->times) left += gpu->times->object.bytes;
    if (gpu->work) left += gpu->work->object.bytes;
    left /= 2;
    if (left > gpu->info.largest) left = (size_t)gpu->info.largest;
    if (left > RTI_GPU_TILE_BYTES) left = RTI_GPU_TILE_BYTES;
    f->space = 1;
    each = rti_gpu_work_bytes(f) - RTI_GPU_ALIGN + sizeof(rt_ray) + sizeof(rt_hit) + sizeof(float);
    most = left / each;
    if (most > RTI_GPU_TILE(gpu)) most = RTI_GPU_TILE(gpu);
    if (pixels > most) pixels = most ? most : 1;
    f->space = (uint32_t)(pixels + 63) / 32 * 32;           /* not a power of 2: numbers of a surface would share a line of the cache */
    status = rti_gpu_stage_tile(gpu, f, NULL);
    if (status != RT_OK) {                  /* what was kept may be large where little is asked for now */
        rti_gpu_give_way(gpu, SIZE_MAX);
        status = rti_gpu_stage_tile(gpu, f, p->error);
    }
    if (status != RT_OK) return status;
    p->buffers[0] = gpu->rays->object.mem;
    p->buffers[1] = gpu->hits->object.mem;
    p->buffers[2] = f->timed ? gpu->times->object.mem : NULL;
    p->pixels = (rti_gpu_pixel *)rti_alloc(f->space, sizeof *p->pixels, gpu->memory_user);
    return p->pixels ? RT_OK : rti_fail(p->error, RT_ERROR_MEMORY, RT_NONE, "no memory for a tile of %u pixels", (unsigned)f->space);
}

/* A step for count rays. turn: which paths are theirs; number: of a light. */
static rt_status rti_gpu_step(const rti_gpu_picture *p, int step, uint32_t count, uint32_t turn, uint32_t number)
{
    const rti_cl work = p->gpu->work->object.mem, times = p->gpu->times->object.mem;
    const rti_gpu_argument arguments[] = {
        { sizeof(rti_cl), &p->scene->object.mem }, { sizeof(rti_cl), &p->scene->accel->object.mem }, { sizeof p->frame, &p->frame },
        { sizeof(rti_cl), &work }, { sizeof(rti_cl), &p->buffers[0] }, { sizeof(rti_cl), &p->buffers[1] }, { sizeof(rti_cl), &times },
        { sizeof count, &count }, { sizeof turn, &turn }, { sizeof number, &number }
    };
    return rti_gpu_run(p->gpu, p->steps->kernels[step], arguments, sizeof arguments / sizeof arguments[0], count, 64, NULL, "rendering", p->error);
}

/* The eye rays of a sample: what the tiles list is tested. */
static rt_status rti_gpu_cover(const rti_gpu_picture *p)
{
    const rti_gpu_task *task = &p->cover;
    const rti_gpu_argument arguments[] = {
        { sizeof(rti_cl), &p->scene->accel->object.mem }, { sizeof(rti_cl), &p->buffers[0] }, { sizeof(rti_cl), &p->buffers[1] },
        { sizeof(rti_cl), &p->raster->mem }, { sizeof p->frame, &p->frame }, { sizeof task->algorithm, &task->algorithm },
        { sizeof task->entries, &task->entries }
    };
    const size_t packets = ((size_t)p->frame.width * p->frame.height + task->program->key.width - 1) / task->program->key.width;
    return rti_gpu_run(p->gpu, task->program->kernels[0], arguments, sizeof arguments / sizeof arguments[0], packets, 64, NULL, "rendering", p->error);
}

/* What lights make of the surfaces that count rays have met. */
static rt_status rti_gpu_light_up(rti_gpu_picture *p, uint32_t count, uint32_t turn)
{
    rt_status status = RT_OK;
    uint32_t number;
    for (number = 0; number < p->scene->light_count && status == RT_OK; number++) {
        status = rti_gpu_step(p, RTI_GPU_AIM, count, turn, number);
        if (status == RT_OK) status = rti_gpu_launch(p->gpu, &p->any, p->scene->accel, p->buffers, 0, count, NULL, p->error);
        if (status == RT_OK) status = rti_gpu_step(p, RTI_GPU_SHINE, count, turn, number);
    }
    return status;
}

/* One sample of count pixels of a tile: of all, or of the first that are listed. */
static rt_status rti_gpu_render_sample(rti_gpu_picture *p, int number, uint32_t count)
{
    rti_gpu_frame *f = &p->frame;
    uint32_t turn = 0;
    bool eye = true;
    rt_status status;
    rti_subpixel(p->first + number, p->spp, &f->dx, &f->dy);
    f->sample = (uint32_t)(p->first + number);
    p->rays.primary += count;
    status = rti_gpu_step(p, RTI_GPU_LOOK, count, turn, (uint32_t)number);
    while (count && status == RT_OK) {
        status = eye && p->raster ? rti_gpu_cover(p)
                                  : rti_gpu_launch(p->gpu, &p->closest, p->scene->accel, p->buffers, 0, count, NULL, p->error);
        eye = false;
        if (status == RT_OK) status = rti_gpu_step(p, RTI_GPU_MEET, count, turn, 0);
        if (status == RT_OK) status = rti_gpu_light_up(p, count, turn);
        if (status != RT_OK || !f->depth) break;
        status = rti_gpu_step(p, RTI_GPU_BOUNCE, count, turn, 0);
        if (status == RT_OK) status = rt_gpu_read(p->gpu->work, 0, &count, sizeof count, p->error);
        turn ^= 1;
    }
    return status == RT_OK && !f->depth ? rt_gpu_finish(p->gpu, p->error) : status;     /* no reads have done so: queues would grow */
}

/* How many samples pixel i of the part at hand gets. */
static uint32_t rti_gpu_samples_of(const rti_gpu_picture *p, size_t i, int width)
{
    const rti_gpu_frame *f = &p->frame;
    const uint32_t *count = p->counts ? &p->counts[(f->top + i / f->width) * (size_t)width + f->left + i % f->width] : NULL;
    return count && *count < (uint32_t)p->samples ? *count : (uint32_t)p->samples;
}

/* Lists the pixels of the part at hand, those with the most samples first, and else in blocks of 8 x 8, so that neighbours stay together:
   *active[n] becomes how many get more than n. */
static rt_status rti_gpu_choose_pixels(rti_gpu_picture *p, int width, uint32_t **active)
{
    void *const user = p->gpu->memory_user;
    const rti_gpu_frame *f = &p->frame;
    const size_t at = rti_gpu_work_bytes(f) - f->space * sizeof(uint32_t);          /* the last of rti_work */
    const uint32_t pixels = f->width * f->height, across = (f->width + 7) / 8, blocks = across * ((f->height + 7) / 8);
    uint32_t *starts = (uint32_t *)rti_alloc((size_t)p->samples + 1, sizeof *starts, user), *list = (uint32_t *)rti_alloc(pixels, sizeof *list, user);
    rt_status status = RT_OK;
    uint32_t i, x, y;
    *active = starts;
    if (!starts || !list) {
        rti_release(list, user);
        return rti_fail(p->error, RT_ERROR_MEMORY, RT_NONE, "no memory to choose the pixels of a tile");
    }
    memset(starts, 0, ((size_t)p->samples + 1) * sizeof *starts);
    for (i = 0; i < pixels; i++) starts[rti_gpu_samples_of(p, i, width)]++;
    for (i = (uint32_t)p->samples; i-- > 0;) starts[i] += starts[i + 1];   /* those that get i or more; where those of i end */
    for (i = blocks; i-- > 0;)
        for (y = 8; y-- > 0;)
            for (x = 8; x-- > 0;) {
                const uint32_t column = i % across * 8 + x, row = i / across * 8 + y, pixel = row * f->width + column;
                if (column < f->width && row < f->height) list[--starts[rti_gpu_samples_of(p, pixel, width)]] = pixel;
            }                               /* now: where those of i begin, which is how many get more */
    status = rti_gpu_send(&p->gpu->work->object, at, list, pixels * sizeof *list, "choosing pixels", p->error);
    rti_release(list, user);
    return status;
}

static rt_status rti_gpu_render_part(rti_gpu_picture *p, const int box[4], int width, rt_vec3 *pixels)
{
    rti_gpu_frame *f = &p->frame;
    uint32_t *active = NULL;                /* pixels with rays, by the number of a sample; NULL: all */
    rt_status status = RT_OK;
    size_t i;
    int number;
    f->left = (uint32_t)box[0];
    f->top = (uint32_t)box[1];
    f->width = (uint32_t)(box[2] - box[0]);
    f->height = (uint32_t)(box[3] - box[1]);
    f->chosen = p->counts != NULL;
    if (p->counts) status = rti_gpu_choose_pixels(p, width, &active);
    for (number = 0; number < p->samples && status == RT_OK && (!active || active[number]); number++)
        status = rti_gpu_render_sample(p, number, active ? active[number] : f->width * f->height);
    rti_release(active, p->gpu->memory_user);
    if (status == RT_OK)
        status = rt_gpu_read(p->gpu->work, RTI_GPU_ALIGN, p->pixels, (size_t)f->width * f->height * sizeof *p->pixels, p->error);
    for (i = 0; i < (size_t)f->width * f->height && status == RT_OK; i++) {
        const rti_gpu_pixel *pixel = &p->pixels[i];
        const uint32_t drawn = rti_gpu_samples_of(p, i, width);
        if (!drawn) continue;
        pixels[(f->top + i / f->width) * (size_t)width + f->left + i % f->width] = rti_scale(pixel->sum, 1 / (float)drawn);
        p->rays.shadow += pixel->shadow;
        p->rays.reflect += pixel->reflect;
        p->rays.refract += pixel->refract;
    }
    return status;
}

/* All of a tile: in parts that there is room for, as wide as can be. */
static rt_status rti_gpu_render_parts(rti_gpu_picture *p, const int tile[4], int width, rt_vec3 *pixels)
{
    const uint32_t across = (uint32_t)(tile[2] - tile[0]), columns = across < p->frame.space ? across : p->frame.space;
    const int most = (int)(p->frame.space / columns);
    rt_status status = RT_OK;
    int box[4];
    for (box[1] = tile[1]; box[1] < tile[3] && status == RT_OK; box[1] = box[3]) {
        box[3] = tile[3] - box[1] > most ? box[1] + most : tile[3];
        for (box[0] = tile[0]; box[0] < tile[2] && status == RT_OK; box[0] = box[2]) {
            box[2] = tile[2] - box[0] > (int)columns ? box[0] + (int)columns : tile[2];
            status = rti_gpu_render_part(p, box, width, pixels);
        }
    }
    return status;
}

RT_API rt_status rt_gpu_render_tile(rt_gpu *gpu, const rt_gpu_scene *scene, const rt_render_options *opt, int x0, int y0, int x1, int y1,
                                    rt_vec3 *pixels, rt_ray_counts *rays)
{
    const int tile[4] = { x0, y0, x1, y1 };
    rti_gpu_picture p;
    rt_status status;
    if (!opt) return RT_ERROR_ARGUMENT;
    if (!gpu || !scene || !pixels)
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", !gpu ? "gpu" : scene ? "pixels" : "scene");
    if (scene->object.gpu != gpu) return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "scene belongs to another context");
    if ((status = rti_check_tile(opt, tile)) != RT_OK) return status;
    if ((status = rti_check_camera(&scene->camera, opt->trace.error)) != RT_OK) return status;
    if (opt->raster && !rti_gpu_raster_fits(opt->raster, scene, opt))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE,
                        "raster was made for another picture: geometry, camera, width and height must be the scene's");
    memset(&p, 0, sizeof p);
    p.gpu = gpu;
    p.scene = scene;
    p.spp = rti_spp_of(opt);
    p.first = opt->first_sample;
    p.samples = rti_drawn_of(opt);
#if RTI_SAMPLING
    p.counts = opt->counts;
#endif
    p.error = opt->trace.error;
    rti_gpu_set_frame(&p, opt);
    if ((status = rti_gpu_find_programs(&p, opt)) != RT_OK || x0 == x1 || y0 == y1) return status;
    if (opt->raster) status = rti_gpu_copy_raster(&p, opt->raster);
    if (status == RT_OK) status = rti_gpu_make_room(&p, (size_t)(x1 - x0) * (size_t)(y1 - y0));
    if (status == RT_OK) status = rti_gpu_render_parts(&p, tile, opt->width, pixels);
    rti_release(p.pixels, gpu->memory_user);
    if (p.raster) rti_gpu_drop(p.raster);
    if (rays && status == RT_OK) {
        rays->primary += p.rays.primary;
        rays->shadow += p.rays.shadow;
        rays->reflect += p.rays.reflect;
        rays->refract += p.rays.refract;
    }
    return status;
}

#endif

#undef RTI_SHARED                           /* rt.h, where it is included again, has its own */
#undef RTI_IN
#endif /* RT_GPU_IMPLEMENTATION */
