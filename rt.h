/* rt.h - ray tracing acceleration structures, traversals and shading in one C header.    SPDX-License-Identifier: MIT OR Unlicense

   Triangles, spheres, planes and nested, moving instances; every traversal algorithm returns the same hit, bit for bit, whatever
   the processor, thread count or compiler flags; closed meshes never leak. C99 and C++11; needs libc and libm only.

   QUICK START

       #define RT_IMPLEMENTATION            // in exactly one C or C++ file
       #include "rt.h"

       static const float vertices[] = { 0,0,0,  1,0,0,  0,1,0 };
       rt_geometry geometry = {0};
       rt_accel *accel;
       rt_ray ray = { {0.2f, 0.3f, 1}, 0, {0, 0, -1}, 100 };        // org, tmin, dir, tmax
       rt_hit hit;

       geometry.vertices = vertices;
       geometry.vertex_count = 3;
       geometry.triangle_count = 1;
       if (rt_build(&accel, &geometry, NULL) != RT_OK) return 1;
       if (rt_intersect(accel, &ray, &hit)) printf("t %g, triangle %u\n", hit.t, hit.prim);
       rt_free(accel);

   CONTENTS (search for the tag)

       declarations    >>config   >>types     >>status   >>geometry  >>build   >>query   >>sampling-api
                       >>camera-api           >>raster-api           >>texture-api       >>shading-api
       implementation  >>platform >>memory    >>math     >>layout    >>instance >>validate >>refs    >>accel   >>bins    >>bvh
                       >>collapse >>kdtree   >>slots     >>threaded >>build-any >>refit    >>info      >>ray      >>frustum  >>tiles    >>surfaces
                       >>passes   >>algorithms >>public  >>leaving >>sampling >>camera   >>raster   >>texture  >>shading  >>render
       one pass a SIMD width (this file includes itself)  >>wide   >>boxes    >>primitives  >>traverse  >>single  >>walk     >>large    >>crowds
                       >>batch    >>cover    >>shade
       license         >>license

   CONVENTIONS

     t           A hit lies at org + t * dir; dir need not be of unit length. A hit counts when tmin < t < tmax.
     u, v        Barycentric weights of vertices 1 and 2 (vertex 0 has 1 - u - v); both 0 on spheres.
     prim        Triangles are numbered first, then spheres, then instances, then planes, in the order the caller gave them.
     closest     The least (t, inst, prim): at equal t the lower inst, then the lower prim wins.
     triangles   Both sides are hit. A triangle seen exactly edge-on, or without area, is not hit; its neighbours are.
     spheres     Both walls are hit: from inside, or with tmin behind the front wall, the back wall answers.
     empty scene Legal: every ray misses.
     bad rays    A ray that is not finite (tmin and tmax may be infinite), whose org lies outside +-RT_MAX_COORDINATE or
                 whose largest |dir| component lies outside [RT_MIN_DIRECTION, RT_MAX_DIRECTION] misses. So does
                 one with tmin >= tmax. The same limits hold in the object space of each instance that it enters.
     rounding    The promise of equal bits is for round-to-nearest. With flush-to-zero set by the program hits stay watertight
                 and equal among the algorithms.

   LIFETIME AND THREADS

     What must stay as it is, and for how long; all else may go when the call returns:

       rt_accel      with opt->reference the vertices, indices and spheres that it was built from, or last refitted to, until rt_free. Each accel
                     that it instances, until rt_free of it; refit or rebuild it after those. memory_user, until rt_free
       rt_raster     all of its geometry and the accels that this instances, until rt_raster_free; memory_user
       rt_scene      accel, geometry and every array, texture and part it points to, while a call runs that is given it. With opt->raster what
                     that needs too
       rt_texture    its levels, likewise
       options       while the call runs, with what they point to: error, stats and times too
       code          an accel belongs to the copy of the library that built it: it is of that one's RT_NO_*, and points into its code

     Queries (rt_intersect to rt_spawn_origin, rt_raster_tile, rt_render_tile, rt_get_info and rt_instance_transform) allocate nothing and may run on
     one accel from any number of threads; they fail for misuse alone. Calls that change an accel, rt_refit and rt_free, are for one thread, while no
     query runs on it or on what instances it, and nothing that instances it is built or refitted. Other builds may run side by side. The library
     starts no thread, prints nothing, opens no file, and has no mutable global but MSVC's one-time processor check.
     Where a comment does not say otherwise: angles are in degrees, lengths in the caller's units, times in [0,1]; a pointer is not kept
     and must not be NULL; a ray takes time O(log n) in most scenes.

   MEMORY

     An accel takes 40 bytes a triangle (4 with opt->reference), 20 bytes a sphere (4), 168 bytes an instance, and its tree: RT_THREADED 32
     bytes a node (0.7 to 1.5 n of them) and 8 for each of opt->orders, and 4 an instance; RT_BVH 32 bytes a node (at most 2 n - 1 nodes,
     about n on meshes), and unless opt->no_wide about 66 a triangle for RT_BVH_WIDE; with opt->no_binary those 66 are all; RT_KDTREE 8
     bytes a node (2 to 3 n on meshes), 14 more unless opt->no_backtrack, and 4 bytes for each time that a leaf with several primitives
     names one (at most opt->max_duplication a primitive). While building, RT_BVH and RT_THREADED take 118 bytes a primitive more, 64 of
     them for nodes, and an RT_BVH first has what no_binary leaves out; RT_KDTREE 32 bytes a reference, twice at the top of the tree, and a
     lane of 1 MiB (208 KiB times opt->max_duplication), or 16 with a parallel_for. All is released before rt_build returns; rt_get_info
     tells what an accel holds. Stack: 2 KiB for a single ray, 7 KiB by wide nodes, 9 KiB for a packet of 4 or 8, and as much again for
     each level of instances; large packets 46 KiB up to 16 x 16 rays, 166 KiB with 32 x 32, and 44 KiB for each level of instances; by
     wide nodes 75 KiB, and 57 KiB for each level. Of a packet of 16 x 16, tests of boxes and edges read 8 KiB and all tests together 20
     KiB: that stays in a first-level cache of 32 KiB. Of one of 32 x 32 only the former do, with 33 KiB, in one of 48.

   WHAT GOES WITH WHAT

     Everything, but for these:

       rt_refit              RT_BVH, RT_THREADED
       opt->reference        vertices, indices and spheres; instances and planes are copied in any case
       infinite planes       not in an accel that is instanced; discs are
       motion                of instances; rt_trace and rt_trace_arrays with opt->times, rt_render_tile with lens.open and close. Others see time 0
       instances             show accels of any structure, but see no_binary, whatever traces the outermost: inside another structure than its
                             own an algorithm goes on as SIMD rays or single ones (kd.stack in k-d trees), with the same hits
       opt->bounds, orders, branching, throw_back     RT_THREADED; empty_bonus, max_duplication: RT_KDTREE
       opt->no_wide          leaves no RT_BVH_WIDE; opt->no_backtrack no RT_KD_BACKTRACK
       opt->no_binary        leaves only RT_BVH_WIDE and RT_AUTO; instances of it stand in accels built so too; rt_gpu_upload refuses it
       opt->cull             RT_BVH_MASKED, RT_BVH_RANGED, RT_BVH_PARTITION
       opt->short_stack      RT_KD_SHORTSTACK
       opt->stats            all; RT_AUTO then does not try by the clock: it takes crowds, without wide nodes large packets, for RT_ANY SIMD rays
       opt->raster           of the same geometry, camera and size; RT_SAMPLER_AUTO, RT_FILTER_BOX, no lens, no shutter
       opt->counts           not with RT_SAMPLER_AUTO

   MACROS, each defined before the include

       RT_IMPLEMENTATION    emit the code here (one file of the program)
       RT_STATIC            with RT_IMPLEMENTATION: make every function static to this file, so that several files may have their own
       RT_MALLOC(n, user), RT_FREE(p, user)   your allocator; user is rt_build_options.memory_user. Both or neither. The thread that
                            calls the library comes here, never one of a parallel_for
       RT_ASSERT(x)         misuse by the programmer; default assert()
       RT_SELF              the name this file includes itself by; default "rt.h"
       RT_NO_SIMD           plain C only: 4-wide packets in scalar code; same hits, slower
       macro        KB of code less, of 561 (gcc 12 -Os; make matrix)
       RT_NO_BVH        254 leave out RT_BVH and its algorithms; rt_build_options.structure must then be set
       RT_NO_KDTREE      84 leave out RT_KDTREE and its algorithms
       RT_NO_THREADED    99 leave out RT_THREADED and its algorithms
       RT_NO_PACKETS    408 leave out every form with packets, and RT_BVH_WIDE, which needs the same SIMD
       RT_NO_SPHERES     10 leave spheres out of rt_geometry and of the code,
       RT_NO_INSTANCES   56 instances, and motion with them,
       RT_NO_PLANES      10 planes and discs
       RT_NO_STATS      109 leave out rt_stats
       RT_NO_SAMPLING    10 leave out samplers, and of the renderer what they serve: lens, shutter, area lights, gloss
       RT_NO_SHADING     69 leave out cameras, rasterised eye rays, materials, textures and the renderer
     Of RT_BVH, single rays and triangles alone 24 KB are left, of another structure 31. In any combination; of the structures one must stay.
     The RT_NO_* of types (SPHERES, INSTANCES, PLANES, STATS, SAMPLING) change structs: define them alike in every file that includes
     this one.

   PAPERS

     [Horn]      Horn, Sugerman, Houston, Hanrahan: Interactive k-D Tree GPU Raytracing, 2007
     [Havran]    Wald, Havran: On building fast kd-Trees for Ray Tracing, and on doing that in O(N log N), 2006
     [Foley]     Foley, Sugerman: KD-Tree Acceleration Structures for a GPU Raytracer, 2005
     [Laine]     Laine: Restart Trail for Stackless BVH Traversal, 2010
     [Lohr]      Lohr: GPU-Based Parallel Stackless BVH Traversal for Animated Distributed Ray Tracing, 2009
     [Cook]      Cook, Porter, Carpenter: Distributed Ray Tracing, 1984
     [Overbeck]  Overbeck, Ramamoorthi, Mark: Large Ray Packets for Real-time Whitted Ray Tracing, 2008
     [Wald]      Wald: On fast Construction of SAH-based Bounding Volume Hierarchies, 2007
     [Bittner]   Bittner, Hapala, Havran: Fast Insertion-Based Optimization of Bounding Volume Hierarchies, 2013
     [Meister]   Meister, Bittner: Parallel Reinsertion for Bounding Volume Hierarchy Optimization, 2018
     [Woop]      Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013
     [Ize]       Ize: Robust BVH Ray Traversal, JCGT 2013
     [Boulos]    Boulos, Wald, Shirley: Geometric and Arithmetic Culling Methods for Entire Ray Packets, 2006
     [Ylitie]    Ylitie, Karras, Laine: Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs, 2017
     [Dammertz]  Dammertz, Hanika, Keller: Shallow Bounding Volume Hierarchies for Fast SIMD Ray Tracing of Incoherent Rays, 2008
     [Haines]    Haines, Guenther, Akenine-Moller: Precision Improvements for Ray/Sphere Intersection, Ray Tracing Gems 2019  */

#ifndef RTI_PASS

/* ==== declarations ================================================================================================== */

#ifndef RT_H
#define RT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- >>config ------------------------------------------------------------------------------------------------------- */

#define RT_HEADER_VERSION 1000              /* major * 1000000 + minor * 1000 + patch */

#ifdef RT_STATIC
#if defined(__GNUC__) || defined(__clang__)
#define RT_API static __attribute__((unused))
#else
#define RT_API static
#endif
#elif defined(__cplusplus)
#define RT_API extern "C"
#else
#define RT_API extern
#endif

/* ---- >>types -------------------------------------------------------------------------------------------------------- */

#define RT_NONE 0xffffffffu                 /* no primitive, no instance */
#define RT_MAX_COORDINATE 1e18f             /* |coordinate| of vertices, sphere extents, instance extents, ray origins */
#define RT_MIN_DIRECTION  1e-30f            /* least and greatest size of the largest component of a ray's dir */
#define RT_MAX_DIRECTION  1e30f
#define RT_MAX_NESTING    8                 /* levels of instances below the accel that is traced */
#define RT_MAX_PRIMITIVES 0x0fffffffu       /* triangles, spheres and instances of one accel together */
#define RT_MAX_SHORT_STACK 32               /* entries of RT_KD_SHORTSTACK */
#define RT_MAX_PACKET     32                /* rays a side of a large packet */
#define RT_MAX_BRANCHING  16                /* children of a node of RT_THREADED */
#define RT_MAX_ANGLE      1000.0f           /* radians that an instance turns from time 0 to 1 */
#define RT_DEPTHS         65                /* depths that a node of a tree can have */

typedef struct { float x, y, z; } rt_vec3;
typedef struct { rt_vec3 org; float tmin; rt_vec3 dir; float tmax; } rt_ray;    /* 32 bytes */
typedef struct { float t, u, v; uint32_t prim, inst; } rt_hit;                  /* 20 bytes; a miss: prim and inst RT_NONE, t infinite */
typedef struct { rt_vec3 center; float radius; } rt_sphere;                     /* radius >= 0 */

typedef struct rt_accel rt_accel;           /* opaque; made by rt_build */

/* ---- >>status ------------------------------------------------------------------------------------------------------- */

#define RT_STATUS_LIST(X)                                                                      \
    X(RT_OK,                "success")                                                         \
    X(RT_ERROR_ARGUMENT,    "an argument or option is not allowed")                            \
    X(RT_ERROR_GEOMETRY,    "a primitive is not finite, out of range or refers to nothing")    \
    X(RT_ERROR_MEMORY,      "out of memory")                                                   \
    X(RT_ERROR_LIMIT,       "more primitives, instances or nesting than the library can number") \
    X(RT_ERROR_UNSUPPORTED, "not built, or not on this processor")                             \
    X(RT_ERROR_NO_DEVICE,   "no such device")

#define RTI_ENUM(name, text) name,
typedef enum { RT_STATUS_LIST(RTI_ENUM) RT_STATUS_COUNT } rt_status;

/* Filled by a call that fails, where its options point to one. */
typedef struct {
    rt_status status;
    uint32_t prim;                          /* the first offending primitive, or RT_NONE */
    char message[192];                      /* one line, no newline */
} rt_error;

/* A constant one-line text; never NULL. */
RT_API const char *rt_status_string(rt_status status);

/* ---- >>geometry ----------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_INSTANCES
/* How an instance goes on from where its transform puts it, while time runs from 0 to 1: it turns about an axis and is moved. At time s
   world = move * s + turn(angle * s) of (transform * object). */
typedef struct {
    rt_vec3 move;
    rt_vec3 pivot, axis;                    /* the line it turns about: through pivot, along axis, of any length */
    float angle;                            /* radians, counterclockwise seen against axis; of at most RT_MAX_ANGLE; 0: axis may be 0 */
} rt_motion;

/* accel seen through an affine transform: world = M * object, M = 3 rows of 4, row by row; must be invertible. */
typedef struct {
    const rt_accel *accel;                  /* not owned; must outlive what instances it */
    float transform[12];
    const rt_motion *motion;                /* NULL: it stands still. Copied by rt_build and rt_refit */
} rt_instance;
#endif

#ifndef RT_NO_PLANES
/* Ground that stays outside of the tree, as [Lohr] 4 has it: an infinite plane, or, with a radius, a disc. Both sides are hit. u and v of
   its hits are 0. */
typedef struct {
    rt_vec3 point, normal;                  /* a point of it, the centre of a disc; normal: of any length but 0 */
    float radius;                           /* of a disc; 0: infinite */
} rt_plane;
#endif

/* Zero it, then set what there is. Nothing is owned. */
typedef struct {
    const float *vertices;    size_t vertex_count, vertex_stride;   /* stride in bytes, a multiple of 4; 0 = 3 packed floats */
    const uint32_t *indices;  size_t triangle_count;                /* NULL indices: vertices 3i, 3i+1, 3i+2 */
#ifndef RT_NO_SPHERES
    const rt_sphere *spheres; size_t sphere_count;
#endif
#ifndef RT_NO_INSTANCES
    const rt_instance *instances; size_t instance_count;
#endif
#ifndef RT_NO_PLANES
    const rt_plane *planes;   size_t plane_count;                   /* each ray tests all of them: meant for a few. An accel with
                                                                       an infinite one cannot be instanced, having no bounds */
#endif
} rt_geometry;

/* ---- >>build -------------------------------------------------------------------------------------------------------- */

#define RT_STRUCTURE_LIST(X) X(RT_BVH, "bvh") X(RT_KDTREE, "kdtree") X(RT_THREADED, "threaded")
typedef enum { RT_STRUCTURE_LIST(RTI_ENUM) RT_STRUCTURE_COUNT } rt_structure;

/* How long to look for a good tree. RT_BVH and RT_THREADED: up to 16, 8, 32 bins of the surface area heuristic an axis; then nodes move to where
   rays cost least ([Meister]): the largest 64th of them, with RT_BUILD_FAST none, and with RT_BUILD_HIGH all. That pays in rooms and where
   triangles are long: there the cost that rt_info tells is 12 to 20 % less by default, and 3 to 8 % less again with RT_BUILD_HIGH, which
   builds 3 to 4.5 times as long. RT_KDTREE: every plane is tried in nodes of up to 32, 8, 64 primitives, 32 bins twice above. */
typedef enum { RT_BUILD_DEFAULT, RT_BUILD_FAST, RT_BUILD_HIGH } rt_quality;

/* What bounds the nodes of RT_THREADED: boxes, or the spheres of [Lohr]. */
#define RT_BOUNDS_LIST(X) X(RT_BOUNDS_BOXES, "boxes") X(RT_BOUNDS_SPHERES, "spheres")
typedef enum { RT_BOUNDS_LIST(RTI_ENUM) RT_BOUNDS_COUNT } rt_bounds;

/* Calls body(context, 0..count-1), each once, in any order, on any threads, and returns when all are done. */
typedef void (*rt_parallel_for)(void *user, size_t count, void (*body)(void *context, size_t index), void *context);

/* Zero is the default of every field. */
typedef struct {
    rt_structure structure;                 /* RT_BVH */
    rt_quality quality;
    bool reference;                         /* read vertices, indices and spheres from the caller's arrays, which must then
                                               stay as they are until rt_free: 36 bytes a triangle less, slower leaves */
    bool skip_invalid;                      /* leave bad primitives out and count them (rt_info.skipped) instead of failing */
    float traversal_cost;                   /* of a node, in primitive tests; 0 = 1.2 for RT_BVH, 1 for RT_KDTREE ([Horn] 4) */
    float empty_bonus;                      /* RT_KDTREE: the part of its cost that a split which cuts off empty space is let off, up to 1;
                                               0 = 0.2, negative: none */
    float max_duplication;                  /* RT_KDTREE: leaves refer to a primitive at most so many times on average, 1 to 64; 0 = 5.
                                               Planes that would pass the limit are not taken: leaves get
                                               fuller, near 1 very full, since hardly a plane cuts nothing */
    rt_bounds bounds;                       /* RT_THREADED: RT_BOUNDS_BOXES */
    int branching;                          /* RT_THREADED: the most children of a node, 2 to RT_MAX_BRANCHING; 0 = the fastest measured */
    int orders;                             /* RT_THREADED: 1, 2, 4 or 8 lists of nodes, each in the order that suits the rays of one (or
                                               more) octants of directions: near nodes come first; 1 is [Lohr]'s. 0 = the fastest measured */
    float throw_back;                       /* RT_THREADED: a node whose surface is above so much of its parent's gives its children to
                                               its parent ([Lohr] 4: pathological ones are thrown back); 0 = the best measured, negative: none */
    bool no_wide;                           /* RT_BVH: leave out what only RT_BVH_WIDE reads. RT_AUTO does without: for single rays it takes
                                               RT_BVH_STACK, for many RT_BVH_RANGED or RT_BVH_SIMD */
    bool no_binary;                         /* RT_BVH: keep only what RT_BVH_WIDE reads, half of a BVH: it, RT_AUTO, rt_intersect and rt_occluded
                                               are left, and rt_refit. Only accels built so too, and rasters, may hold instances of it. Not
                                               with no_wide */
    bool no_backtrack;                      /* RT_KDTREE: leave out the parent links and boxes that only RT_KD_BACKTRACK reads */
    rt_parallel_for parallel_for;           /* NULL: build on this thread. The tree is the same, bit for bit */
    void *parallel_user;
    void *memory_user;                      /* given to RT_MALLOC and RT_FREE */
    rt_error *error;                        /* NULL: only the status tells */
} rt_build_options;

/* Builds *out from geo: O(n log n) time (binned SAH, [Wald], and reinsertion, [Meister]; k-d trees with clipping, [Havran]; depth at most 64
   on any input), opt NULL = defaults.
   RT_ERROR_GEOMETRY names the first bad primitive. On any failure *out is NULL and nothing is kept. */
RT_API rt_status rt_build(rt_accel **out, const rt_geometry *geo, const rt_build_options *opt);

/* Releases accel; NULL is fine. */
RT_API void rt_free(rt_accel *accel);

/* Moves the primitives to where geo says, keeping the tree: O(n), no allocation. geo must have the counts that accel was built
   from; indices are read again. Accels that instance this one must be refitted or rebuilt after it. A primitive that build left out stays
   out; one that has become bad fails the call. On failure accel is as it was. error may be NULL. RT_BVH and RT_THREADED (with spheres O(n
   log n)): the planes of a k-d tree cut primitives where they were, so that answers RT_ERROR_UNSUPPORTED. */
RT_API rt_status rt_refit(rt_accel *accel, const rt_geometry *geo);
RT_API rt_status rt_refit_error(rt_accel *accel, const rt_geometry *geo, rt_error *error);

typedef struct {
    rt_structure structure;
    size_t triangles, spheres, instances, planes;       /* as given; including skipped ones */
    size_t skipped;                         /* primitives left out by skip_invalid */
    size_t nodes, leaves, max_leaf;         /* tree nodes in all, leaves among them, primitives in the fullest leaf; with no_binary, as depth
                                               and sah, of the wide tree */
    size_t empty_leaves;                    /* of a k-d tree */
    size_t references;                      /* primitives in all leaves together: k-d trees count one once a leaf */
    int depth;                              /* edges from the root to the deepest leaf */
    int nesting;                            /* levels of instances below this accel */
    size_t bytes;                           /* held by this accel (not by accels it instances) */
    double sah;                             /* expected cost of a ray that hits the root box, in primitive tests; with the default costs */
    rt_vec3 lower, upper;                   /* bounds, but for infinite planes; lower > upper when empty */
} rt_info;

/* O(n). */
RT_API void rt_get_info(const rt_accel *accel, rt_info *info);

#ifndef RT_NO_INSTANCES
/* The composed object-to-world transform (3x4, row by row) and the matrix for its normals (3x3, inverse transpose, not
   normalised) of the instance a hit names. inst RT_NONE: the identity. Either output may be NULL. False: no such instance, or
   normal is asked for and does not fit in floats. O(log instances) a level. */
RT_API bool rt_instance_transform(const rt_accel *accel, uint32_t inst, float transform[12], float normal[9]);

/* The same at a time in [0,1], where instances of the path move. rt_instance_transform is at time 0. */
RT_API bool rt_instance_transform_at(const rt_accel *accel, uint32_t inst, float time, float transform[12], float normal[9]);
#endif

/* ---- >>query -------------------------------------------------------------------------------------------------------- */

/* THE table of algorithms: enum value, command line name, structure, what. The enum, rt_algorithm_find, the tests, bench and
   --help all come from here; rti_algorithms (>>algorithms) adds the code. */
#define RT_ALGORITHM_LIST(X)                                                                                         \
    X(RT_AUTO,              "auto",              RT_STRUCTURE_COUNT, "the best one for the rays given")              \
    X(RT_KD_STACK,          "kd.stack",          RT_KDTREE,   "front to back with a stack (Horn A.1)")               \
    X(RT_KD_RESTART,        "kd.restart",        RT_KDTREE,   "restart at the root (Horn A.2)")                      \
    X(RT_KD_PUSHDOWN,       "kd.pushdown",       RT_KDTREE,   "restart at the lowest enclosing subtree (Horn A.3)")  \
    X(RT_KD_SHORTSTACK,     "kd.shortstack",     RT_KDTREE,   "bounded stack over push-down (Horn A.4)")             \
    X(RT_KD_BACKTRACK,      "kd.backtrack",      RT_KDTREE,   "parent links and node boxes (Foley & Sugerman)")      \
    X(RT_BVH_STACK,         "bvh.stack",         RT_BVH,      "single ray, scalar, binary tree")                     \
    X(RT_BVH_WIDE,          "bvh.wide",          RT_BVH,      "single rays, or packets that stay together while it pays, against 8 children at once") \
    X(RT_BVH_SIMD,          "bvh.simd",          RT_BVH,      "4 (2x2) or 8 rays in SIMD lanes (Overbeck 2.1)")      \
    X(RT_BVH_MASKED,        "bvh.masked",        RT_BVH,      "large packets, masked (Overbeck 3.1)")                \
    X(RT_BVH_RANGED,        "bvh.ranged",        RT_BVH,      "large packets, first active ray (Overbeck 3.2)")      \
    X(RT_BVH_PARTITION,     "bvh.partition",     RT_BVH,      "large packets, partitioned (Overbeck 3.3)")           \
    X(RT_THREADED_SINGLE,   "threaded.single",   RT_THREADED, "stackless, hit and miss links (Lohr 4)")              \
    X(RT_THREADED_PARALLEL, "threaded.parallel", RT_THREADED, "stackless, k rays together (Lohr 5)")

#define RTI_ALGORITHM_ENUM(name, text, structure, what) name,
typedef enum { RT_ALGORITHM_LIST(RTI_ALGORITHM_ENUM) RT_ALGORITHM_COUNT } rt_algorithm;

/* Frustum culling of large packets ([Overbeck] 4): boxes and triangles that no ray of the packet can hit are thrown out by the four side
   planes of a frustum around it, by its corner rays, or by both. It never changes a hit. A frustum needs rays that go the same way along
   some axis and do not start before their origin (tmin >= 0); others are traced without. Tight ones come of rays with one origin, or
   that end in one point at t = 1, as shadow rays do. */
#define RT_CULL_LIST(X) X(RT_CULL_NONE, "none") X(RT_CULL_CORNERS, "corners") X(RT_CULL_PLANES, "planes") X(RT_CULL_BOTH, "both")
typedef enum { RT_CULL_LIST(RTI_ENUM) RT_CULL_COUNT } rt_cull;

typedef enum { RT_CLOSEST, RT_ANY } rt_query;

/* Which instructions; for tests and measurements. The hits are the same. RT_ISA_SCALAR packets exist only where RT_ISA_AUTO picks them
   (RT_NO_SIMD, or no x86). */
#define RT_ISA_LIST(X) X(RT_ISA_AUTO, "auto") X(RT_ISA_SCALAR, "scalar") X(RT_ISA_SSE2, "sse2") X(RT_ISA_AVX2, "avx2")
typedef enum { RT_ISA_LIST(RTI_ENUM) RT_ISA_COUNT } rt_isa;

typedef struct {
    const char *name;                       /* "bvh.stack" */
    const char *what;
    rt_algorithm algorithm;
    rt_structure structure;                 /* RT_STRUCTURE_COUNT: any */
    bool built;                             /* false: rt_trace answers RT_ERROR_UNSUPPORTED */
    bool packets;                           /* packet_width may be other than 1 */
    bool culls;                             /* has frusta: cull may be other than RT_CULL_NONE */
} rt_algorithm_info;

/* One row of the table, or NULL past its end: for (i = 0; (info = rt_algorithm_get(i)) != NULL; i++). */
RT_API const rt_algorithm_info *rt_algorithm_get(size_t i);

/* The packet widths that algorithm takes on this processor, ascending: writes up to max of them to widths, returns how many there are. */
RT_API size_t rt_packet_widths(rt_algorithm algorithm, int *widths, size_t max);

#ifndef RT_NO_STATS
/* Sums over the rays of a call; added to what is there. One ray in one node is one visit: a packet of 5 live rays adds 5. */
typedef struct {
    uint64_t rays;                          /* legal rays traced */
    uint64_t nodes;                         /* inner nodes visited */
    uint64_t leaves;                        /* leaves visited */
    uint64_t boxes;                         /* ray-box tests */
    uint64_t prims;                         /* ray-primitive tests; in k-d trees an instance counts in every leaf */
    uint64_t restarts;                      /* k-d tree restarts */
    uint64_t pushes, drops;                 /* stack entries pushed, and lost from a full short stack */
    uint64_t steps, active;                 /* packet node visits, and live rays summed over them: active / steps a visit */
    uint64_t frusta, culled;                /* boxes and triangles tested against what bounds a packet, and those thrown out */
    uint64_t boxes_at[RT_DEPTHS], prims_at[RT_DEPTHS];      /* large packets, but of RT_BVH_WIDE: boxes and prims by the depth of their node */
} rt_stats;
#endif

/* Zero is the default of every field. */
typedef struct {
    rt_algorithm algorithm;                 /* RT_AUTO */
    int packet_width;                       /* 0 = the default; else one of rt_packet_widths. SIMD rays and k-d trees: 1 = single rays,
                                               2 = 2x2, 8 = 8 rays, 0 = the widest. RT_BVH_WIDE: 4, 8 or 16 rays a side, 0 and 1
                                               = single rays. Large packets: 4, 8, 16 or 32 rays a side, 0 = 16.
                                               RT_THREADED_PARALLEL: 2, 4, 8 or 16 rays together, 0 = 8 */
    rt_cull cull;                           /* of large packets but those of RT_BVH_WIDE; RT_AUTO decides itself */
    rt_query query;                         /* RT_CLOSEST */
    int short_stack;                        /* RT_KD_SHORTSTACK: entries, 1 to RT_MAX_SHORT_STACK; 0 = 3, as in [Horn] */
    const float *times;                     /* one a ray in [0,1], for moving instances; NULL = 0. What lies outside counts as the
                                               nearer of both, NaN as 0 */
    rt_isa isa;
#ifndef RT_NO_STATS
    rt_stats *stats;                        /* NULL: nothing is counted, at no cost */
#endif
    rt_error *error;
} rt_trace_options;

/* Closest hit of one ray; fills *hit (also for a miss). True: hit. */
RT_API bool rt_intersect(const rt_accel *accel, const rt_ray *ray, rt_hit *hit);

/* Is there any hit with tmin < t < tmax? */
RT_API bool rt_occluded(const rt_accel *accel, const rt_ray *ray);

/* Traces rays[0..count) and fills hits[0..count); any count, any order. Packets are made of rays that follow each other, so
   give neighbours together: in Morton order, say, where 4, 16, 64, 256 rays are squares. opt NULL = defaults. RT_ANY answers prim 0 for
   a hit, RT_NONE for a miss.
   Fails only for options that are not allowed (RT_ERROR_ARGUMENT), not built or not on this processor (RT_ERROR_UNSUPPORTED); hits is
   then untouched. */
RT_API rt_status rt_trace(const rt_accel *accel, const rt_trace_options *opt, const rt_ray *rays, size_t count, rt_hit *hits);

/* The same from and to structures of arrays: element i of each array belongs to ray i. Lanes are loaded as they stand, without a transpose,
   and what is not wanted is not written. */
typedef struct {
    const float *org[3], *dir[3];           /* x, y, z */
    const float *tmin, *tmax;               /* NULL: all 0; all infinite */
    bool one_org;                           /* org has one element, the origin of all rays */
} rt_ray_arrays;
typedef struct { float *t, *u, *v; uint32_t *prim, *inst; } rt_hit_arrays;      /* each may be NULL */

RT_API rt_status rt_trace_arrays(const rt_accel *accel, const rt_trace_options *opt, const rt_ray_arrays *rays, size_t count,
                                 const rt_hit_arrays *hits);

/* The origin of a ray that goes on from a hit: in front of the surface, on the side that dir points to (of a dir within it: that of ray), so
   near that it skips no other, so far that with tmin 0 and any dir to that side it does not meet the surface again. ray, hit: what was traced,
   hit->prim not RT_NONE. geo: what the accel that holds the primitive was built from: the one traced, or the innermost of hit->inst; transform:
   that of hit->inst, see rt_instance_transform_at; NULL where inst is RT_NONE. O(1); the same bits whatever the compiler.
     The point is that of u and v, not of t, which errs by more, and is moved along the normal by a bound on what rounding may do to the next
   ray: for a triangle 2e-6 of its size as seen from there, and for all the roundings of the coordinates: 2e-7 of those, some ten times as much
   below a transform (after pbrt, 4th ed., 6.8). Within the triangle it is kept away from the edges by 8 times as much, or as far as its width
   allows: so in a corner it does not lie behind a neighbour either, if they meet at 15 degrees or more. In a sharper wedge, or one of triangles
   thinner than that, light may leak; so it may below transforms that move by much and back again. */
RT_API rt_vec3 rt_spawn_origin(const rt_geometry *geo, const float transform[12], const rt_ray *ray, const rt_hit *hit, rt_vec3 dir);

/* The instruction set that RT_ISA_AUTO picks here. */
RT_API rt_isa rt_best_isa(void);

/* ---- >>sampling-api ------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SAMPLING

/* Numbers in [0,1) for distribution ray tracing ([Cook], [Lohr] 7). AUTO is SOBOL; the renderer places its samples within a pixel
   regularly then, alike in every pixel, so that nothing is noisy where nothing is distributed.
   INDEPENDENT   a hash of all arguments: errors fall as n^-1/2
   STRATIFIED    one sample in each of n cells, a grid in 2D, in shuffled order
   SOBOL         Owen-scrambled Sobol' points, shuffled (Burley 2020): 2^m of them, from any multiple of 2^m on, are stratified in all ways
                 at once, and so are 4^m in the four numbers of dimensions 2k and 2k + 1, and 16^m in the sixteen of dimensions 8k to
                 8k + 7; on smooth integrands errors fall as n^-3/2 */
#define RT_SAMPLER_LIST(X) X(RT_SAMPLER_AUTO, "auto") X(RT_SAMPLER_INDEPENDENT, "independent") X(RT_SAMPLER_STRATIFIED, "stratified") \
                           X(RT_SAMPLER_SOBOL, "sobol")
typedef enum { RT_SAMPLER_LIST(RTI_ENUM) RT_SAMPLER_COUNT } rt_sampler_kind;

#define RT_MAX_SPP (1 << 20)                /* samples a pixel */

/* Zero is the default of every field. */
typedef struct {
    rt_sampler_kind kind;
    uint32_t spp;                           /* samples that there will be, at most RT_MAX_SPP; 0 = 1. STRATIFIED alone needs to know */
    uint32_t seed, frame;                   /* each gives new numbers */
} rt_sampler;

/* Number `sample`, below spp, of a pixel and a dimension. Dimensions are independent of each other, but that SOBOL's are stratified together
   as above: what matters most together belongs in 2k and 2k + 1. The numbers of one call of rt_sample_2d are always stratified together.
   Any pixel, sample, dimension, frame and seed is legal, in any order: nothing is kept. O(1). */
RT_API float rt_sample_1d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension);
RT_API void rt_sample_2d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension, float point[2]);

#endif

/* ---- >>camera-api --------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

/* A pinhole. fov is the vertical angle of the picture in degrees, in (0, 180). */
typedef struct { rt_vec3 eye, look, up; float fov; } rt_camera;

#ifndef RT_NO_SAMPLING
/* A thin lens in the place of the pinhole, and a shutter. Zeroed it is the pinhole again, which sees the world at time 0. */
typedef struct {
    float radius;                           /* of the lens, around eye, in units of the world */
    float focus;                            /* what lies so deep along the view axis is sharp; 0: as deep as look */
    float open, close;                      /* when the shutter is, 0 <= open <= close <= 1: each ray has a time between, all alike likely */
} rt_lens;

/* The ray of rt_camera_ray through a point of the lens: of the square [0,1) x [0,1), which is laid onto the disc evenly. t is depth, tmin
   0. All rays of a pixel meet in the plane of focus. Its time is the caller's to choose. */
RT_API rt_ray rt_lens_ray(const rt_camera *camera, const rt_lens *lens, float x, float y, int width, int height, const float on_lens[2]);
#endif

/* The camera's ray through point (x, y) of a width x height picture, in pixels from the top left corner (a pixel's middle is at
   +0.5); width and height >= 1. dir has unit depth along the view axis: t is depth. tmin is 0, tmax infinite. */
RT_API rt_ray rt_camera_ray(const rt_camera *camera, float x, float y, int width, int height);

/* ---- >>raster-api --------------------------------------------------------------------------------------------------- */

/* Eye rays without a tree: [Horn] 4 rasterises what the camera sees and traces only what follows. The hits are those of rt_trace with
   the rays of rt_camera_ray, bit for bit. That pays for a picture or a few of geometry that changes: sorting the primitives into the tiles
   of the picture costs far less than building a tree. */

/* Zero is the default of every field. */
typedef struct {
    bool skip_invalid;                      /* leave bad primitives out and count them (rt_raster_info.skipped) instead of failing */
    float offset_x, offset_y;               /* rt_rasterize: the sample from the pixel's middle, right and down, -0.5 to 0.5 pixels */
    rt_parallel_for parallel_for;           /* NULL: on this thread. Lists and hits are the same, bit for bit */
    void *parallel_user;
    void *memory_user;                      /* given to RT_MALLOC and RT_FREE */
    rt_isa isa;
    rt_error *error;                        /* NULL: only the status tells */
} rt_raster_options;

typedef struct rt_raster rt_raster;         /* opaque: the primitives of a geometry, sorted into the tiles of a picture */

/* Sorts geo's primitives into the tiles of the picture that camera sees: O(n) time, opt NULL = defaults. Width and height are 1 to 2^20.
   geo is not copied: its arrays must stay as they are until rt_raster_free. Takes 20 bytes a primitive, 4 bytes for each tile that a seen
   one is listed in (1 to 4, on meshes between 1 and 2), at most 8 bytes a seen primitive for the tiles themselves, 128 bytes an
   instance; while sorting as many bytes for tiles again, 8 times as many with parallel_for. Large primitives are listed in large tiles,
   so nothing grows with the picture.
   RT_ERROR_GEOMETRY names the first bad primitive, as rt_build does. On any failure *out is NULL and nothing is kept. */
RT_API rt_status rt_raster_create(rt_raster **out, const rt_geometry *geo, const rt_camera *camera, int width, int height,
                                  const rt_raster_options *opt);

/* The hits of the pixels [x0,x1) x [y0,y1), written to hits, which holds the whole picture row by row: of the rays through
   (x + dx, y + dy), dx and dy in [0, 1]. Any number of threads may share r. No allocation, 52 KiB of stack and as much as rt_trace takes
   for instances. RT_ERROR_ARGUMENT for what is NULL or leaves the picture or the pixel; hits is then untouched. */
RT_API rt_status rt_raster_tile(const rt_raster *r, int x0, int y0, int x1, int y1, float dx, float dy, rt_hit *hits);

typedef struct {
    size_t skipped;                         /* primitives left out by skip_invalid */
    size_t seen;                            /* those that lie in some tile; the others cannot be hit */
    size_t tiles, entries;                  /* tiles of all sizes, primitives listed in all of them together */
    size_t bytes;                           /* held by the raster (not by accels it instances) */
} rt_raster_info;

RT_API void rt_raster_get_info(const rt_raster *r, rt_raster_info *info);

/* Releases r; NULL is fine. */
RT_API void rt_raster_free(rt_raster *r);

/* All of it in one call: fills hits[0 .. width * height). Faster than the calls above by what misses every sample and is never listed.
   Errors as those; hits is then untouched. */
RT_API rt_status rt_rasterize(const rt_geometry *geo, const rt_camera *camera, int width, int height, const rt_raster_options *opt,
                              rt_hit *hits);

/* ---- >>texture-api -------------------------------------------------------------------------------------------------- */

/* What multiplies a material's diffuse colour, or raises its surface (bump mapping, Blinn 1978). Each is filtered over the piece of the
   surface that a pixel sees, so that it does not shimmer. */
#define RT_TEXTURE_LIST(X) X(RT_TEXTURE_IMAGE, "image") X(RT_TEXTURE_CHECKER, "checker") X(RT_TEXTURE_NOISE, "noise")
typedef enum { RT_TEXTURE_LIST(RTI_ENUM) RT_TEXTURE_COUNT } rt_texture_kind;

typedef struct {
    rt_texture_kind kind;
    const rt_vec3 *levels;                  /* IMAGE: of rt_make_texture_levels; linear RGB. Repeats; (0, 0) is the lower left corner */
    int width, height;                      /* IMAGE: of its first level, 1 to 2^14 */
    rt_vec3 colors[2];                      /* CHECKER, NOISE: what they alternate, or vary, between. Both black: black and white */
    float size;                             /* CHECKER: edge of a field, NOISE: of its largest waves, in units of the surface's texture
                                               coordinates, or with solid of its space; 0 = 1 */
    bool solid;                             /* CHECKER, NOISE: in three dimensions, by position in the space of the primitive; else in two, by
                                               texture coordinates: of a mesh its own, of a sphere longitude and latitude in [0,1] with y
                                               up, of a plane distance along two directions of it, in units of the world */
} rt_texture;

/* An image's levels: itself, then halved again and again down to 1 x 1, each the mean of what it stands for. */
RT_API size_t rt_count_texture_levels(int width, int height);       /* rt_vec3s in all levels together; 0: not 1 to 2^14 */
RT_API void rt_make_texture_levels(const rt_vec3 *pixels, int width, int height, rt_vec3 *levels);      /* pixels: rows from the top; O(pixels) */

/* ---- >>shading-api -------------------------------------------------------------------------------------------------- */

#define RT_MAX_DEPTH 64                     /* levels of reflection and refraction */

#ifndef RT_NO_SAMPLING
/* How the samples of a pixel weigh what is around its middle: samples are placed as dense as the filter is high, so all count alike and
   pixels need not know of each other. BOX: the pixel itself; TENT: a pyramid 2 pixels wide; GAUSSIAN: deviation 1/2 pixel, cut off at 3/2.
   */
#define RT_FILTER_LIST(X) X(RT_FILTER_BOX, "box") X(RT_FILTER_TENT, "tent") X(RT_FILTER_GAUSSIAN, "gaussian")
typedef enum { RT_FILTER_LIST(RTI_ENUM) RT_FILTER_COUNT } rt_filter;
#endif

/* Phong's shading and Whitted's secondary rays. Colours are linear RGB, reflectances in [0,1]. Where reflect + transmit exceed 1 in a
   channel, both are scaled to that sum: a surface gives no more light than falls on it. */
typedef struct {
    rt_vec3 diffuse, specular, emission;
    float shininess;                        /* exponent of the highlight */
    rt_vec3 reflect;                        /* what of the light from the mirrored direction is seen; 0: no mirror */
    rt_vec3 transmit;                       /* what of the light from behind is seen, refracted; 0: opaque. Where nothing is refracted,
                                               beyond the critical angle, it is mirrored */
    rt_vec3 absorb;                         /* inside, light is weakened by exp(-absorb * length) */
    float ior;                              /* index of refraction of the inside against the outside; 0 = 1: nothing is bent */
    bool fresnel;                           /* transmit is split between both ways by Fresnel's equations */
#ifndef RT_NO_SAMPLING
    float roughness;                        /* 0 to 1: what is mirrored or refracted spreads around its direction as the (2 / roughness^2 - 2)th
                                               power of the cosine; 0: not at all */
#endif
    const rt_texture *texture;              /* multiplies diffuse; or NULL */
    const rt_texture *bump;                 /* height of the surface above itself: the texture's mean of RGB, times bump_height; or NULL */
    float bump_height;                      /* in units of the space of the primitive */
} rt_material;

/* A point; no falloff, as in Phong's model. With a size it is the mean over its points as seen from the surface: by solid angle, so that
   nearer and less tilted parts count more, as they do on a real lamp. It is not seen itself: give it a body that glows, smaller than it,
   to see. */
typedef struct {
    rt_vec3 position, color;
#ifndef RT_NO_SAMPLING
    float radius;                           /* of a sphere around position; 0: none */
    rt_vec3 edges[2];                       /* of a rectangle, two sides that meet in a corner, at right angles; position is its middle. It shines
                                               to both sides */
    bool by_area;                           /* choose points evenly on its surface, with weights, not by solid angle: the same light, usually
                                               noisier */
#endif
} rt_light;

/* Everything a picture needs; nothing is owned. Primitive ids are those of geometry. The outside of a triangle is where its vertices
   run counterclockwise; what transmits should be closed, or is a pane that bends what passes as the face of a block would. */
typedef struct rt_scene {
    const rt_accel *accel;
    const rt_geometry *geometry;            /* what accel was built from */
    const rt_vec3 *normals;                 /* shading normals, or NULL */
    const uint32_t *normal_indices;         /* 3 a triangle into normals; a triangle whose first is RT_NONE is flat */
    const rt_vec3 *colors;                  /* one a vertex, multiplies the diffuse colour; or NULL */
    const rt_material *materials; size_t material_count;            /* none: light grey */
    const uint32_t *material_ids;           /* one a triangle, then one a sphere, then one a plane; NULL: material 0 */
    const float *texcoords;                 /* pairs u v, or NULL: the weights u, v of the hit */
    const uint32_t *texcoord_indices;       /* 3 a triangle into the pairs; a triangle whose first is RT_NONE has the weights */
    const rt_light *lights; size_t light_count;
    rt_vec3 ambient, background;
    rt_camera camera;
    const struct rt_scene *const *parts;    /* one an instance: how to shade what it shows (accel, geometry, normals, materials, parts) */
} rt_scene;

/* Checks what rt_render_tile takes for granted, in O(size of scene): numbers of materials and lights are finite and not negative, material
   ids are in range, every instance has a part. RT_ERROR_ARGUMENT says what is not. Parts are scenes of their own, to be checked by
   themselves. Unchecked, a bad number makes bad pixels and no worse, a bad id reads what is not there. error may be NULL. */
RT_API rt_status rt_check_scene(const rt_scene *scene, rt_error *error);

typedef struct {
    int width, height;                      /* of the whole picture */
    int spp;                                /* samples a pixel, at most RT_MAX_SPP; 0 = 1 */
    int first_sample, samples;              /* draw those alone of the spp: `samples` from first_sample on; 0 = all that are left. So a
                                               picture refines: the caller weighs what several calls draw */
    int depth;                              /* levels of reflection and refraction that follow an eye ray, at most RT_MAX_DEPTH; 0 = 5,
                                               negative: none */
    rt_trace_options trace;                 /* algorithm and so on; query is set by the renderer */
    const rt_raster *raster;                /* NULL: eye rays are traced. Else rasterised with this, which was made of scene->geometry,
                                               scene->camera, width and height: the same picture, bit for bit. Only of a pinhole, with
                                               RT_SAMPLER_AUTO and RT_FILTER_BOX */
#ifndef RT_NO_SAMPLING
    rt_lens lens;
    rt_sampler_kind sampler;                /* RT_SAMPLER_AUTO */
    rt_filter filter;                       /* RT_FILTER_BOX */
    uint32_t seed, frame;                   /* each gives new noise */
    const uint32_t *counts;                 /* NULL, or one for each pixel of the picture: it gets so many samples, if that is less than
                                               `samples`; pixels of 0 stay as they are. Not with RT_SAMPLER_AUTO, the first of whose
                                               samples are in one corner of the pixel */
#endif
} rt_render_options;

typedef struct { uint64_t primary, shadow, reflect, refract; } rt_ray_counts;

/* Each sample of a pixel is a tree of rays, as Whitted's, of which every one that may spread is sent in one direction by chance ([Cook],
   [Lohr] 7): through a point of the pixel and of the lens, at a time, to a point of each light, along the lobe of each rough mirror and
   glass. The mean over all chances is what the picture tends to; opt->spp samples differ from it by noise. What a scene and opt do not use
   costs neither samples nor rays. Renders the pixels [x0,x1) x [y0,y1) of the picture to pixels, which holds the whole picture row by row
   (linear RGB): so tiles may be rendered by any threads in any order, with any algorithm, and the picture is the same. rays may be NULL;
   counts are added to it. Threads may share scene and opt, but not what is written: rays, opt->trace.error and opt->trace.stats. Tiles
   that start and end at multiples of 32 pixels are the fastest. A ray whose part of its pixel is below 1/512 in every channel is left out.
   So a sample has at most 1536 rays a level, whatever the materials, and some hundreds in all behind surfaces that reflect one half and
   transmit the other. Errors as rt_trace; RT_ERROR_ARGUMENT where opt->raster is of another camera, size or number of primitives. Eye rays
   that are rasterised are counted in rays, not in opt->trace.stats. No allocation. Stack: 176 KiB for blocks of 16 x 16 pixels, 620 KiB
   for those of 32 x 32 that an opt->trace.packet_width above 16 asks for; 6 KiB more with raster, 60 KiB more a level of instances. */
RT_API rt_status rt_render_tile(const rt_scene *scene, const rt_render_options *opt, int x0, int y0, int x1, int y1, rt_vec3 *pixels,
                                rt_ray_counts *rays);

#endif /* RT_NO_SHADING */
#endif /* RT_H */

/* ==== implementation ================================================================================================ */

/* What the device of rt_gpu.h does alike is compiled twice from one text: as C here, and as OpenCL C, for which rt_gpu.h includes this file
   again with RTI_TEXT, the name of a part. Then RTI_SHARED makes strings of what stands in it, and RTI_IN leaves out all but that part.
   So shared text keeps to what both languages have, and has no # in it. Memory of an accel or a scene is RTI_GLOBAL. */
#ifndef RTI_TEXT
#define RTI_SHARED(...) __VA_ARGS__
#define RTI_IN(part) 1
#endif

#if (defined(RT_IMPLEMENTATION) && !defined(RTI_IMPLEMENTED)) || defined(RTI_TEXT)
#if RTI_IN(HOST)
#define RTI_IMPLEMENTED

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- >>platform ----------------------------------------------------------------------------------------------------- */

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(_M_FP_FAST)
#error "rt.h: -ffast-math and its parts break watertight hits; compile the file that defines RT_IMPLEMENTATION without them"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "rt.h: float arithmetic must round to float: compile with -msse2 -mfpmath=sse where there is x87, for s390x with -std=gnu99 instead of c99"
#endif

#if defined(RT_MALLOC) != defined(RT_FREE)
#error "rt.h: define both RT_MALLOC and RT_FREE, or neither"
#endif
#ifndef RT_MALLOC
#include <stdlib.h>
#define RT_MALLOC(size, user) ((void)(user), malloc(size))
#define RT_FREE(pointer, user) ((void)(user), free(pointer))
#endif
#ifndef RT_ASSERT
#include <assert.h>
#define RT_ASSERT(x) assert(x)
#endif
#ifndef RT_SELF
#define RT_SELF "rt.h"
#endif

/* Features as 0/1, so that the code below says #if and not #ifdef. */
#ifdef RT_NO_SPHERES
#define RTI_SPHERES 0
#else
#define RTI_SPHERES 1
#endif
#ifdef RT_NO_INSTANCES
#define RTI_INSTANCES 0
#else
#define RTI_INSTANCES 1
#endif
#ifdef RT_NO_PLANES
#define RTI_PLANES 0
#else
#define RTI_PLANES 1
#endif
#ifdef RT_NO_BVH
#define RTI_BVH 0
#else
#define RTI_BVH 1
#endif
#ifdef RT_NO_THREADED
#define RTI_THREADED 0
#else
#define RTI_THREADED 1
#endif
#ifdef RT_NO_SAMPLING
#define RTI_SAMPLING 0
#else
#define RTI_SAMPLING 1
#endif
#ifdef RT_NO_KDTREE
#define RTI_KDTREE 0
#else
#define RTI_KDTREE 1
#endif
#ifdef RT_NO_STATS
#define RTI_STATS 0
#else
#define RTI_STATS 1
#endif
#if defined(_MSC_VER) && !defined(__clang__)
#define RTI_MSVC 1
#else
#define RTI_MSVC 0
#endif
#ifdef RT_NO_PACKETS
#define RTI_PACKETS 0
#else
#define RTI_PACKETS 1
#endif
#define RTI_WIDES (RTI_PACKETS && RTI_BVH)      /* wide nodes and large packets */
#if !RTI_BVH && !RTI_KDTREE && !RTI_THREADED
#error "rt.h: RT_NO_BVH, RT_NO_KDTREE and RT_NO_THREADED leave no structure to build"
#endif
#if !defined(RT_NO_SIMD) && (defined(__x86_64__) || defined(_M_X64) || (defined(__i386__) && defined(__SSE2__)))
#define RTI_X86 1
#include <immintrin.h>
#ifdef _MSC_VER
#include <intrin.h>
#endif
#else
#define RTI_X86 0
#endif
#if RTI_X86 && !RTI_MSVC && !defined(__OPTIMIZE_SIZE__)
#define RTI_SINGLE_FMA 1                    /* single rays twice, with fma too: little is gained, and fmaf of MSVC is a call */
#else
#define RTI_SINGLE_FMA 0
#endif

/* RTI_HOT: what traversals are made of, inlined whatever the compiler thinks. RTI_INLINE: too, but where -Os asks for little code. */
#if defined(__GNUC__) || defined(__clang__)
#define RTI_HOT static inline __attribute__((always_inline, unused))
#ifdef __OPTIMIZE_SIZE__
#define RTI_INLINE static inline __attribute__((unused))
#else
#define RTI_INLINE RTI_HOT
#endif
#define RTI_NOINLINE static __attribute__((noinline, unused))
#define RTI_ALIGNED(n) __attribute__((aligned(n)))
#define RTI_UNLIKELY(x) __builtin_expect(!!(x), 0)
#define RTI_PREFETCH(p) __builtin_prefetch(p, 0, 3)
#define RTI_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define RTI_HOT static __forceinline
#define RTI_INLINE RTI_HOT
#define RTI_NOINLINE static __declspec(noinline)
#define RTI_ALIGNED(n) __declspec(align(n))
#define RTI_UNLIKELY(x) (x)
#define RTI_PREFETCH(p) ((void)(p))
#define RTI_PRINTF(text, first)
#pragma fp_contract(off)
#endif

/* Before a short loop of constant length: at -O2 gcc else keeps it a loop, and the arrays of vectors that it runs over in memory. */
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE_SIZE__)
#define RTI_UNROLL _Pragma("GCC unroll 8")
#else
#define RTI_UNROLL
#endif

/* rti_round*(x) is x, rounded: it keeps the compiler from contracting a product with the sum that takes it into one fma, which gcc and
   clang do at their users' flags even to intrinsics, and which would give other bits than the other paths. No instruction is emitted. */
#if defined(__GNUC__) || defined(__clang__)
#if defined(__x86_64__) || defined(__i386__)
#define RTI_ROUND(x) __asm__("" : "+x"(x))
#elif defined(__aarch64__) || defined(__arm__)
#define RTI_ROUND(x) __asm__("" : "+w"(x))
#elif defined(__riscv) || defined(__s390__)
#define RTI_ROUND(x) __asm__("" : "+f"(x))
#elif defined(__wasm__)
#define RTI_ROUND(x) ((void)0)              /* has no fma to contract to */
#else
#define RTI_ROUND(x) __asm__("" : "+m"(x))
#endif
#else
#define RTI_ROUND(x) ((void)0)              /* fp_contract(off) above */
#endif

/* Shared text, see RTI_SHARED, as C has it. Where an accel has pointers here the device has numbers, which RTI_OPEN reads, and where a scene
   has them, distances, which RTI_FOLLOW adds. RTI_SHOWS: may scenes have that? A device's program is for one scene, and knows. */
#define RTI_GLOBAL
#define RTI_FOLLOW(type, from, field) ((from)->field)       /* the type that a thing of a scene refers to, or NULL */
#define RTI_SHOWS(things) true
#define RTI_OPEN(name, parent, accel) const rt_accel *const name = (accel)     /* an instance's accel, by what the instance keeps of it */
#define RTI_KNOWN_SIDES(p) (RTI_WIDTH == 1 || (p)->uniform)
#define RTI_STACK RTI_MAX_DEPTH             /* entries */
#define RTI_SHORT_STACK RT_MAX_SHORT_STACK

RTI_INLINE float rti_roundf(float x) { RTI_ROUND(x); return x; }
RTI_INLINE double rti_round(double x) { RTI_ROUND(x); return x; }

/* The same in what is not RTI_TARGET, where it costs nothing unless the program is compiled for a processor with fma: no instruction, but
   products that pass one by one are not packed into vectors (a fifth of the time of textures). */
#if (defined(__x86_64__) || defined(__i386__)) && !defined(__FMA__) && !defined(__FMA4__)
RTI_INLINE float rti_keepf(float x) { return x; }
RTI_INLINE double rti_keep(double x) { return x; }
#else
RTI_INLINE float rti_keepf(float x) { return rti_roundf(x); }
RTI_INLINE double rti_keep(double x) { return rti_round(x); }
#endif

#if RTI_X86
#if defined(__GNUC__) || defined(__clang__)
#define RTI_TARGET_AVX2 __attribute__((target("avx2,fma")))
#else
#define RTI_TARGET_AVX2
#endif

#if (defined(_WIN64) || (defined(__CYGWIN__) && defined(__x86_64__))) && defined(__GNUC__) && !defined(__clang__)
/* There the stack is aligned to 16 bytes, and gcc keeps 32 byte vectors on it as if to 32 (its bug 54412): they crash by chance. */
static bool rti_has_avx2(void) { return false; }
#elif !RTI_MSVC
static bool rti_has_avx2(void) { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
static bool rti_ask_avx2(void)
{
    int r[4];
    __cpuid(r, 0);
    if (r[0] < 7) return false;
    __cpuid(r, 1);
    if (!(r[2] >> 12 & 1) || !(r[2] >> 27 & 1) || (_xgetbv(0) & 6) != 6) return false;      /* fma, osxsave, ymm state */
    __cpuidex(r, 7, 0);
    return r[1] >> 5 & 1;
}
/* Asked once, since cpuid costs more than many a ray. Threads that race here write the same answer. */
static bool rti_has_avx2(void)
{
    static volatile long known;
    if (!known) known = rti_ask_avx2() ? 2 : 1;
    return known == 2;
}
#endif
#endif

/* ---- >>memory ------------------------------------------------------------------------------------------------------- */

/* count * size bytes, or NULL: also where the product overflows. A count of 0 allocates something. */
static void *rti_alloc(size_t count, size_t size, void *user)
{
    if (count > SIZE_MAX / size) return NULL;
    return RT_MALLOC(count ? count * size : 1, user);
}

static void rti_release(void *pointer, void *user)
{
    (void)user;
    if (pointer) RT_FREE(pointer, user);
}

/* Every failure passes through here: the place for a breakpoint. */
RTI_PRINTF(4, 5)
static rt_status rti_fail(rt_error *error, rt_status status, uint32_t prim, const char *format, ...)
{
    if (error) {
        va_list args;
        va_start(args, format);
        error->status = status;
        error->prim = prim;
        vsnprintf(error->message, sizeof error->message, format, args);
        va_end(args);
    }
    return status;
}

/* ---- >>math --------------------------------------------------------------------------------------------------------- */

#define RTI_INFINITY ((float)HUGE_VAL)

/* x y z; the fourth lanes are padding that SIMD may fill with anything. */
typedef struct { float lo[4], hi[4]; } rti_box;

static const rti_box rti_empty_box = { { HUGE_VALF, HUGE_VALF, HUGE_VALF, 0 }, { -HUGE_VALF, -HUGE_VALF, -HUGE_VALF, 0 } };

RTI_INLINE void rti_box_grow(rti_box *box, const float *lo, const float *hi)        /* lo and hi have 4 readable floats */
{
#if RTI_X86
    _mm_storeu_ps(box->lo, _mm_min_ps(_mm_loadu_ps(lo), _mm_loadu_ps(box->lo)));
    _mm_storeu_ps(box->hi, _mm_max_ps(_mm_loadu_ps(hi), _mm_loadu_ps(box->hi)));
#else
    int k;
    for (k = 0; k < 3; k++) {
        if (lo[k] < box->lo[k]) box->lo[k] = lo[k];
        if (hi[k] > box->hi[k]) box->hi[k] = hi[k];
    }
#endif
}

/* Half the surface; in double, since 1e18 squared times a count leaves float. Empty: 0. */
static double rti_half_area(const rti_box *box)
{
    double x = (double)box->hi[0] - (double)box->lo[0], y = (double)box->hi[1] - (double)box->lo[1];
    double z = (double)box->hi[2] - (double)box->lo[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
}

/* The nearest floats not above and not below x. */
RTI_INLINE float rti_float_up(double x)
{
    float f = (float)x;
    uint32_t bits;
    if (!((double)f < x)) return f;
    memcpy(&bits, &f, sizeof bits);         /* the next float: floats of one sign are ordered as their bits are */
    if (bits << 1 == 0) bits = 1;
    else bits += bits >> 31 ? 0xffffffffu : 1;
    memcpy(&f, &bits, sizeof f);
    return f;
}
RTI_INLINE float rti_float_down(double x) { return -rti_float_up(-x); }

RTI_INLINE bool rti_coordinate_ok(float x) { return x >= -RT_MAX_COORDINATE && x <= RT_MAX_COORDINATE; }     /* false for NaN */

static int rti_ceil_log2(size_t n)
{
    int log = 0;
    while (((size_t)1 << log) < n) log++;
    return log;
}

#endif
#if RTI_IN(BASE)
RTI_SHARED(
RTI_INLINE float rti_maxf(float a, float b) { return a > b ? a : b; }       /* fmaxf is a call */
)

#if RTI_INSTANCES || !defined(RT_NO_SHADING)
/* Sine and cosine of at most RT_MAX_ANGLE radians, within 1e-15: of our own, since those of C libraries differ in their last bits. The angle
   is brought to [-pi/4, pi/4] by quarters, pi/2 being taken off in two parts of which the first has few enough bits to be exact. */
RTI_SHARED(
static void rti_sine_cosine(double angle, double *sine, double *cosine)
{
    const double quarters = floor(rti_keep(angle * 0.63661977236758134) + 0.5);
    const double x = angle - rti_keep(quarters * 1.5707963267341256) - rti_keep(quarters * 6.0771005065061922e-11), y = rti_keep(x * x);
    const int quarter = (int)quarters & 3;
    double s = -1.0 / 1307674368000.0, c = -1.0 / 87178291200.0;
    s = rti_keep(s * y) + 1.0 / 6227020800.0;
    s = rti_keep(s * y) - 1.0 / 39916800.0;
    s = rti_keep(s * y) + 1.0 / 362880.0;
    s = rti_keep(s * y) - 1.0 / 5040.0;
    s = rti_keep(s * y) + 1.0 / 120.0;
    s = rti_keep(s * y) - 1.0 / 6.0;
    s = x + rti_keep(x * rti_keep(s * y));
    c = rti_keep(c * y) + 1.0 / 479001600.0;
    c = rti_keep(c * y) - 1.0 / 3628800.0;
    c = rti_keep(c * y) + 1.0 / 40320.0;
    c = rti_keep(c * y) - 1.0 / 720.0;
    c = rti_keep(c * y) + 1.0 / 24.0;
    c = rti_keep(c * y) - 0.5;
    c = 1 + rti_keep(c * y);
    *sine = (quarter & 1 ? c : s) * (1 - (quarter & 2));
    *cosine = (quarter & 1 ? s : c) * (1 - ((quarter + 1) & 2));
}
)
#endif
#endif
#ifndef RT_NO_SHADING
#if RTI_IN(HOST)
RTI_INLINE uint64_t rti_double_bits(double x) { uint64_t bits; memcpy(&bits, &x, sizeof bits); return bits; }
RTI_INLINE double rti_bits_double(uint64_t bits) { double x; memcpy(&x, &bits, sizeof x); return x; }
#endif
#if RTI_IN(SHADING)
#if RTI_SAMPLING
/* The same of so much of a full turn, -1/8 to 1, within 2e-7. */
RTI_SHARED(
RTI_INLINE void rti_circle(float turn, float *sine, float *cosine)
{
    const int quarter = (int)(4 * turn + 0.5f);
    const float x = rti_keepf((4 * turn - (float)quarter) * 1.57079633f), y = rti_keepf(x * x);
    float s = 2.75573192e-6f, c = 2.48015873e-5f;
    s = rti_keepf(s * y) - 1.98412698e-4f;
    s = rti_keepf(s * y) + 8.33333333e-3f;
    s = rti_keepf(s * y) - 0.166666667f;
    s = x + rti_keepf(x * rti_keepf(s * y));
    c = rti_keepf(c * y) - 1.38888889e-3f;
    c = rti_keepf(c * y) + 4.16666667e-2f;
    c = rti_keepf(c * y) - 0.5f;
    c = 1 + rti_keepf(c * y);
    *sine = (quarter & 1 ? c : s) * (float)(1 - (quarter & 2));
    *cosine = (quarter & 1 ? s : c) * (float)(1 - ((quarter + 1) & 2));
}
)
#endif

/* What else would come from C libraries, for the same reason: in double, so that rounded to float hardly a last bit is wrong. */

/* Within 3e-10 of the value; of less than -700 and more than 700 as of these, which float rounds to 0 and infinity. By the part that powers
   of 2 leave, within -+ln(2)/2, as a power series. */
RTI_SHARED(
static double rti_exp(double x)
{
    const double within = x < -700 ? -700 : x > 700 ? 700 : x;
    const int power = within == within ? (int)(rti_keep(within * 1.4426950408889634) + (within < 0 ? -0.5 : 0.5)) : 0;
    const double r = within - rti_keep(power * 0.69314718036912382) - rti_keep(power * 1.9082149292705877e-10), y = rti_keep(r * r);
    double even = 1.0 / 40320, odd = 1.0 / 5040;
    even = rti_keep(even * y) + 1.0 / 720;
    odd = rti_keep(odd * y) + 1.0 / 120;
    even = rti_keep(even * y) + 1.0 / 24;
    odd = rti_keep(odd * y) + 1.0 / 6;
    even = rti_keep(even * y) + 0.5;
    odd = rti_keep(odd * y) + 1;
    even = rti_keep(even * y) + 1;
    return (even + rti_keep(odd * r)) * rti_bits_double((uint64_t)(1023 + power) << 52);
}
)

/* Within 1e-12, of normal numbers and 0. With x = 2^power m, m within sqrt(2) of 1: the series of artanh((m - 1) / (m + 1)). */
RTI_SHARED(
static double rti_log(double x)
{
    const uint64_t bits = rti_double_bits(x);
    const int power = (int)((bits + ((uint64_t)0x95f62 << 32)) >> 52) - 1023;       /* the fractions from sqrt(2) on carry */
    const double m = rti_bits_double(bits - ((uint64_t)power << 52));
    const double f = (m - 1) / (m + 1), y = rti_keep(f * f), yy = rti_keep(y * y);
    double p = 1.0 / 11, q = 1.0 / 13;
    if (!(x > 0)) return x == 0 ? -(double)RTI_INFINITY : (x - x) / (x - x);
    if (x - x != 0) return x;
    p = rti_keep(p * yy) + 1.0 / 7;
    q = rti_keep(q * yy) + 1.0 / 9;
    p = rti_keep(p * yy) + 1.0 / 3;
    q = rti_keep(q * yy) + 1.0 / 5;
    return rti_keep(power * 0.69314718055994531) + (2 * f + rti_keep(2 * f * rti_keep(rti_keep(p * y) + rti_keep(q * yy))));
}
)

RTI_SHARED(
static float rti_expf(float x) { return (float)rti_exp((double)x); }

static float rti_powf(float x, float y)     /* x is not negative */
{
    return y == 0 || x == 1 ? 1 : (float)rti_exp(rti_keep((double)y * rti_log((double)x)));
}
)
#if RTI_SAMPLING
RTI_SHARED(
static float rti_logf(float x) { return (float)rti_log((double)x); }
)
#endif

/* The angle of (x, y), which are finite, as atan2 has it, within 1e-15: less that of (4, part), one is left whose tangent is at most 1/8, for
   the series. Without branches, which processors would guess wrong. */
RTI_SHARED(
static double rti_arc_tangent_ratio(double y, double x)
{
    const double known[5] = { 0, 0.24497866312686414, 0.46364760900080609, 0.64350110879328437, 0.78539816339744828 };
    const double high = fabs(y), wide = fabs(x), least = high < wide ? high : wide, most = wide < high ? high : wide;
    const int part = (8 * least > most) + (8 * least > 3 * most) + (8 * least > 5 * most) + (8 * least > 7 * most);
    const int steep = high > wide, back = copysign(1.0, x) < 0;
    const double c = 0.25 * part, t = (least - rti_keep(c * most)) / (most + rti_keep(c * least)), z = rti_keep(t * t), zz = rti_keep(z * z);
    double p = 1.0 / 13, q = 1.0 / 15, angle;
    p = 1.0 / 9 + rti_keep(p * zz);
    q = 1.0 / 11 + rti_keep(q * zz);
    p = 1.0 / 5 + rti_keep(p * zz);
    q = 1.0 / 7 + rti_keep(q * zz);
    p = rti_keep(p * zz) - rti_keep(z * (1.0 / 3 + rti_keep(q * zz)));
    angle = most > 0 ? known[part] + (t + rti_keep(t * p)) : 0;
    return copysign((steep ? 1 : 2 * back) * 1.5707963267948966 + (1 - 2 * (steep ^ back)) * angle, y);
}
)

RTI_SHARED(
static float rti_atan2f(float y, float x) { return (float)rti_arc_tangent_ratio((double)y, (double)x); }
)
#endif
#endif
#if RTI_IN(HOST)

/* ---- >>layout ------------------------------------------------------------------------------------------------------- */

/* node, 32 bytes                                          triangle, 40 bytes
     bounds[0..2] lower x y z   bounds[3..5] upper x y z     v[0..8] three vertices   prim
     index  inner: first of two children, index and index + 1;  leaf: first slot in the array of its kind
     count  0: inner node;  else leaf: kind << 28 | number of primitives (a leaf holds one kind only)

   Nodes stand in depth-first order: a child's index is above its parent's. */

enum { RTI_TRIANGLE, RTI_SPHERE, RTI_INSTANCE, RTI_KINDS, RTI_PLANE = RTI_KINDS + 1 };       /* planes are in no leaf */
#define RTI_COUNT_MASK 0x0fffffffu
#define RTI_KIND_SHIFT 28
#define RTI_MAX_PRIMS ((size_t)RT_MAX_PRIMITIVES)   /* 2 n - 1 nodes fit in 32 bits */
#define RTI_MAX_DEPTH (RT_DEPTHS - 1)       /* edges; a traversal stack holds at most one entry a level */
#define RTI_MAX_LEAF 8                      /* primitives: what is more is split, by halving where SAH finds no plane */

#endif
#if RTI_IN(BASE)
RTI_SHARED(
typedef struct { float bounds[6]; uint32_t index, count; } rti_node;
)
/* k-d tree node, 8 bytes
     split  inner: where the plane stands                    count  leaf: kind << 28 | number of primitives
     word   bits 0-1: the plane's axis, or 3 for a leaf
            inner: bit 2: the lower child is empty, bit 3: the upper child is; bits 4-31: half the index of the lower child
            leaf: bits 2-31: where its entries of kdslots start; of a leaf with one primitive, that primitive's slot
   The root is node 0 and node 1 is left free: so children are 2 j and 2 j + 1, never in two cache lines, and what belongs to their
   parent, links[j], is found from either. A leaf of kind RTI_MIXED holds several kinds, one after the other. Entries of kdslots tell the
   kind in their upper bits, as count does: a primitive in several leaves is stored once. */
RTI_SHARED(
typedef struct { union { float split; uint32_t count; } as; uint32_t word; } rti_kdnode;
typedef struct { float bounds[6]; uint32_t parent; } rti_kdlink;
)
/* node of RT_BVH_WIDE, 256 bytes: 8 children, by coordinate. A child is an inner node, its count 0, or a leaf, its count as in rti_node and its
   index that of an octet, or, without octets, of the first slot. Where there is no child is a leaf with nothing in it, whose box, upside down,
   is missed by all but the shortest rays, which may miss no box.
   octet, 320 bytes: the triangles of a leaf side by side; what is left of it repeats the first. */
#define RTI_CHILDREN 8
#define RTI_NO_CHILD ((uint32_t)RTI_KINDS << RTI_KIND_SHIFT)
#define RTI_WIDE_STACK (RTI_MAX_DEPTH * (RTI_CHILDREN - 1) + RTI_CHILDREN)
RTI_SHARED(
typedef struct { float bounds[6][8]; uint32_t index[8], count[8]; } rti_wide;
typedef struct { float v[9][8]; uint32_t prim[8]; } rti_octet;
typedef char rti_check_wide[sizeof(rti_wide) == 256 ? 1 : -1];
)
/* node of RT_THREADED: the same, but that index of an inner node is not used and that bounds may be a sphere: x y z of its centre, its
   radius. Nodes stand in depth-first order. Where to go on is told by the node's link in one of the lists of links, by the ray's
   direction. */
RTI_SHARED(
typedef struct { uint32_t hit, miss; } rti_link;            /* of a leaf both are where to go on behind it */

typedef struct { float v[9]; uint32_t prim; } rti_triangle;
typedef struct { float center[3], radius; uint32_t prim; } rti_ball;
typedef struct { float point[3], normal[3], radius; uint32_t prim; } rti_ground;

typedef char rti_check_ray[sizeof(rt_ray) == 32 ? 1 : -1];
typedef char rti_check_hit[sizeof(rt_hit) == 20 ? 1 : -1];
typedef char rti_check_node[sizeof(rti_node) == 32 ? 1 : -1];
typedef char rti_check_kdnode[sizeof(rti_kdnode) == 8 ? 1 : -1];
typedef char rti_check_triangle[sizeof(rti_triangle) == 40 ? 1 : -1];
)
#endif
#if RTI_IN(HOST)
typedef char rti_check_count[RT_MAX_PRIMITIVES <= RTI_COUNT_MASK ? 1 : -1];       /* a leaf of a k-d tree may hold all of them */
#define RTI_END 0xffffffffu                  /* nowhere, of links */
#define RTI_MIXED RTI_KINDS
#define RTI_LEAF 3u                          /* the axis of leaves */
#define RTI_KD_LOWER_EMPTY 4u
#define RTI_KD_UPPER_EMPTY 8u
#define RTI_KD_EMPTY (RTI_KD_LOWER_EMPTY | RTI_KD_UPPER_EMPTY)
#define RTI_KD_PAIR 4                        /* shift of the children's index / 2 */
#define RTI_DUPLICATION 5                    /* references a primitive: the default limit, */
#define RTI_MAX_DUPLICATION 64               /* and the greatest */
#define RTI_MAX_REFERENCES ((size_t)1 << 28) /* of one tree: nodes and slots fit in 30 bits */

RTI_INLINE bool rti_kd_empty(const rti_kdnode *node) { return (node->word & 3) == RTI_LEAF && !node->as.count; }
RTI_INLINE uint32_t rti_kd_children(const rti_kdnode *node) { return (node->word & ~15u) / 8; }

#if RTI_INSTANCES
typedef struct {
    const rt_accel *accel;
    float transform[12], inverse[12];       /* object to world, and back, at time 0 */
    uint32_t prim, base;                    /* base: what a hit on accel's own primitives is called in hit.inst */
    bool moves;                             /* then: */
    rt_motion motion;
} rti_instance;
#endif

typedef struct rti_job rti_job;
typedef void (*rti_batch_function)(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits);
typedef void (*rti_any_walker)(void);       /* an rti_walker of some pass */

struct rt_accel {
    rt_structure structure;
    rti_batch_function single;              /* what traces a single ray, */
    const rti_job *single_jobs;             /* by query, */
    rti_any_walker single_walks[2];         /* and, of its pass, what that walks the tree by: all as fits what the accel has */
    rti_node *nodes;                        /* RT_BVH: node_count of them, the root first; none when empty, or with opt->no_binary: see rti_only_wide */
#if RTI_WIDES
    rti_wide *wides;                        /* the same tree for RT_BVH_WIDE, in wide_memory; NULL with opt->no_wide */
    rti_octet *octets;                      /* likewise; NULL with opt->reference */
    void *wide_memory;
    size_t wide_count, octet_count;
#endif
#if RTI_KDTREE
    rti_kdnode *kdnodes;                    /* RT_KDTREE: likewise */
    rti_kdlink *kdlinks;                    /* node_count / 2; NULL with opt->no_backtrack */
    uint32_t *kdslots;                      /* kdslot_count slots, of all leaves with more than one primitive */
    size_t kdslot_count;
    size_t references;                      /* from leaves to primitives */
#endif
#if RTI_THREADED
    rti_link *links;                        /* RT_THREADED: orders lists of node_count */
    int orders, order_axes[3];              /* bit i of a list's number: it is for directions that are negative along order_axes[i] */
    rt_bounds bounds;
    uint32_t *instance_nodes;               /* from an instance's slot to its leaf */
#endif
    rti_triangle *triangles;                /* in leaf order; or, with opt->reference: */
    uint32_t *triangle_ids;
#if RTI_SPHERES
    rti_ball *balls;
    uint32_t *ball_ids;
#endif
    size_t node_count;
    size_t slots[RTI_KINDS];                /* primitives of each kind that are in the tree */
    rt_geometry geo;                        /* the counts; with opt->reference the caller's arrays too */
    size_t skipped;
#if RTI_PLANES
    rti_ground *planes;                     /* good ones, by number */
    size_t plane_count;
    bool endless;                           /* one of them is infinite */
#endif
#if RTI_INSTANCES
    bool moves;                             /* an instance does, at any level below */
    rti_instance *instances;                /* in leaf order */
    uint32_t *instance_slots;               /* from instance number to slot, or RT_NONE */
    uint32_t *instance_bases;               /* instance number to base, ascending */
    uint32_t paths;                         /* how many values hit.inst can take below this accel */
#endif
    float lower[3], upper[3];               /* of the root */
    float outer_lower[3], outer_upper[3];   /* with discs */
    float extent, spread;                   /* see >>instance; both 0 without instances */
    int depth, nesting;
    size_t bytes;
    void *memory_user;
};

RTI_INLINE void rti_set_bounds(rti_node *node, const rti_box *box)
{
    memcpy(node->bounds, box->lo, 3 * sizeof(float));
    memcpy(node->bounds + 3, box->hi, 3 * sizeof(float));
}

/* Half the surface of its box. */
RTI_INLINE double rti_node_area(const rti_node *node)
{
    rti_box box;
    memcpy(box.lo, node->bounds, 3 * sizeof(float));
    memcpy(box.hi, node->bounds + 3, 3 * sizeof(float));
    return rti_half_area(&box);
}

#if RTI_WIDES
/* Of all children: where there is none, its box upside down adds nothing. */
static rti_box rti_wide_bounds(const rti_wide *wide)
{
    rti_box box = rti_empty_box;
    int i, k;
    for (k = 0; k < 3; k++)
        for (i = 0; i < RTI_CHILDREN; i++) {
            if (wide->bounds[k][i] < box.lo[k]) box.lo[k] = wide->bounds[k][i];
            if (wide->bounds[3 + k][i] > box.hi[k]) box.hi[k] = wide->bounds[3 + k][i];
        }
    return box;
}

/* Of all triangles. */
static rti_box rti_octet_bounds(const rti_octet *octet)
{
    rti_box box = rti_empty_box;
    int i, k;
    for (k = 0; k < 9; k++)
        for (i = 0; i < RTI_CHILDREN; i++) {
            if (octet->v[k][i] < box.lo[k % 3]) box.lo[k % 3] = octet->v[k][i];
            if (octet->v[k][i] > box.hi[k % 3]) box.hi[k % 3] = octet->v[k][i];
        }
    return box;
}
#endif

RTI_INLINE int rti_leaf_kind(const rti_node *node) { return (int)(node->count >> RTI_KIND_SHIFT); }
RTI_INLINE uint32_t rti_leaf_count(const rti_node *node) { return node->count & RTI_COUNT_MASK; }

RTI_INLINE size_t rti_sphere_count(const rt_geometry *geo)
{
#if RTI_SPHERES
    return geo->sphere_count;
#else
    (void)geo;
    return 0;
#endif
}
RTI_INLINE size_t rti_instance_count(const rt_geometry *geo)
{
#if RTI_INSTANCES
    return geo->instance_count;
#else
    (void)geo;
    return 0;
#endif
}
RTI_INLINE size_t rti_plane_count(const rt_geometry *geo)
{
#if RTI_PLANES
    return geo->plane_count;
#else
    (void)geo;
    return 0;
#endif
}

/* Primitives that a tree can hold: all but planes, whose numbers follow. */
RTI_INLINE size_t rti_tree_count(const rt_geometry *geo) { return geo->triangle_count + rti_sphere_count(geo) + rti_instance_count(geo); }

/* Is its tree one of wide nodes alone, with no binary one? Then node_count counts those. */
RTI_INLINE bool rti_only_wide(const rt_accel *accel) { return RTI_WIDES && accel->structure == RT_BVH && accel->node_count && !accel->nodes; }

/* Can nothing be hit? */
RTI_INLINE bool rti_is_empty(const rt_accel *accel)
{
#if RTI_PLANES
    if (accel->plane_count) return false;
#endif
    return !accel->node_count;
}

RTI_INLINE int rti_kind_of(const rt_geometry *geo, size_t prim)
{
    return prim < geo->triangle_count ? RTI_TRIANGLE : prim - geo->triangle_count < rti_sphere_count(geo) ? RTI_SPHERE : RTI_INSTANCE;
}

/* The primitive's vertices; bad indices give false. Coordinates are not looked at. */
RTI_INLINE bool rti_fetch_triangle(const rt_geometry *geo, size_t prim, float v[9])
{
    size_t stride = geo->vertex_stride ? geo->vertex_stride : 3 * sizeof(float);
    int k;
    for (k = 0; k < 3; k++) {
        size_t i = geo->indices ? geo->indices[3 * prim + (size_t)k] : 3 * prim + (size_t)k;
        if (i >= geo->vertex_count) return false;
        memcpy(v + 3 * k, (const char *)geo->vertices + i * stride, 3 * sizeof(float));
    }
    return true;
}

/* ---- >>instance ----------------------------------------------------------------------------------------------------- */

/* hit.inst numbers the paths through nested instances in depth-first order: with paths(accel) = sum over its instances (1 + paths(child)),
   instance j is called base_j = sum over i < j (1 + paths(child_i)), and what lies inside it follows: base_j + 1 + number in the child.
   Where nothing nests, base_j = j. Unsigned wrap-around makes RT_NONE the base of the outermost accel: RT_NONE + 1 + n = n. */

#endif
#if RTI_IN(SHADING) && RTI_INSTANCES

/* 3x4 inverse in double, rounded once. Products of two floats are exact in double, so only the others need RTI_ROUND. */
RTI_SHARED(
static bool rti_invert(const float m[12], float inverse[12])
{
    double c[9], inv[9], det;
    int i, j;
    for (i = 0; i < 3; i++)                 /* c = cofactors, transposed: inverse = c / det */
        for (j = 0; j < 3; j++) {
            int r1 = (j + 1) % 3, r2 = (j + 2) % 3, c1 = (i + 1) % 3, c2 = (i + 2) % 3;
            c[3 * i + j] = (double)m[4 * r1 + c1] * (double)m[4 * r2 + c2] - (double)m[4 * r1 + c2] * (double)m[4 * r2 + c1];
        }
    det = rti_round((double)m[0] * c[0]) + rti_round((double)m[1] * c[3]);
    det += rti_round((double)m[2] * c[6]);
    for (i = 0; i < 9; i++) inv[i] = c[i] / det;
    for (i = 0; i < 3; i++) {
        double t = rti_round(inv[3 * i] * (double)m[3]) + rti_round(inv[3 * i + 1] * (double)m[7]);
        t += rti_round(inv[3 * i + 2] * (double)m[11]);
        for (j = 0; j < 3; j++) inverse[4 * i + j] = (float)inv[3 * i + j];
        inverse[4 * i + 3] = (float)-t;
    }
    for (i = 0; i < 12; i++)
        if (!(fabsf(inverse[i]) <= FLT_MAX)) return false;     /* det 0 makes inf or NaN */
    return true;
}
)

/* Largest row sum of |3x3|: how much the transform can stretch the largest coordinate. */
RTI_SHARED(
static double rti_stretch(const float m[12])
{
    double most = 0;
    int i;
    for (i = 0; i < 3; i++) {
        double row = fabs((double)m[4 * i]) + fabs((double)m[4 * i + 1]) + fabs((double)m[4 * i + 2]);
        if (row > most) most = row;
    }
    return most;
}
)

#endif
#if RTI_IN(BASE) && RTI_INSTANCES
/* The rotation of a motion at a time, row by row (Rodrigues). Every product is rounded by itself: the same bits from every compiler. */
RTI_SHARED(
RTI_NOINLINE void rti_turn(const rt_motion *motion, double time, double r[9])
{
    const double axis[3] = { (double)motion->axis.x, (double)motion->axis.y, (double)motion->axis.z };
    double k[3], length, s, c, most = 0;
    int i, j;
    for (i = 0; i < 9; i++) r[i] = i % 4 == 0;
    if (!(motion->angle != 0)) return;      /* the axis may be 0 */
    rti_sine_cosine(rti_round((double)motion->angle * time), &s, &c);
    for (i = 0; i < 3; i++) most = fabs(axis[i]) > most ? fabs(axis[i]) : most;
    for (i = 0; i < 3; i++) k[i] = axis[i] / most;
    length = rti_round(k[0] * k[0]) + rti_round(k[1] * k[1]);
    length = sqrt(length + rti_round(k[2] * k[2]));
    for (i = 0; i < 3; i++) k[i] /= length;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            const double both = rti_round(rti_round(k[i] * k[j]) * (1 - c));
            const int other = 3 - i - j;
            if (i == j) r[3 * i + j] = c + both;
            else if ((i + 1) % 3 == j) r[3 * i + j] = both - rti_round(k[other] * s);
            else r[3 * i + j] = both + rti_round(k[other] * s);
        }
}
)

/* The time that counts: of [0,1]; of NaN 0. */
RTI_SHARED(
RTI_INLINE float rti_clamp_time(float time) { return time > 0 ? time < 1 ? time : 1 : 0; }
)

/* A ray as it is seen by what has not moved: turned and moved back, and rounded to floats once. */
RTI_SHARED(
RTI_NOINLINE void rti_move_back(const rt_motion *motion, float time, float org[3], float dir[3])
{
    const double move[3] = { (double)motion->move.x, (double)motion->move.y, (double)motion->move.z };
    const double pivot[3] = { (double)motion->pivot.x, (double)motion->pivot.y, (double)motion->pivot.z };
    double r[9], o[3], d[3];
    int i;
    rti_turn(motion, (double)time, r);
    for (i = 0; i < 3; i++) {
        o[i] = (double)org[i] - rti_round(move[i] * (double)time) - pivot[i];
        d[i] = (double)dir[i];
    }
    for (i = 0; i < 3; i++) {               /* by the transpose */
        const double x = rti_round(r[i] * o[0]) + rti_round(r[3 + i] * o[1]), y = rti_round(r[i] * d[0]) + rti_round(r[3 + i] * d[1]);
        org[i] = (float)(x + rti_round(r[6 + i] * o[2]) + pivot[i]);
        dir[i] = (float)(y + rti_round(r[6 + i] * d[2]));
    }
}
)

/* The ray in object space; t keeps its meaning since dir is not normalised. */
RTI_SHARED(
RTI_INLINE void rti_transform_ray(const float inverse[12], const float org[3], const float dir[3], float to_org[3], float to_dir[3])
{
    int i;
    for (i = 0; i < 3; i++) {               /* float products are exact in double: contraction cannot change a bit */
        const float *m = inverse + 4 * i;
        to_org[i] = (float)((double)m[0] * (double)org[0] + (double)m[1] * (double)org[1] + (double)m[2] * (double)org[2] + (double)m[3]);
        to_dir[i] = (float)((double)m[0] * (double)dir[0] + (double)m[1] * (double)dir[1] + (double)m[2] * (double)dir[2]);
    }
}
)
#endif
#if RTI_IN(HOST) && RTI_INSTANCES

/* Where a motion carries the points p within part i of n of the time: adds that to lo and hi. Between its ends a point on a circle of
   radius r that turns by a strays from the straight line by at most r a^2 / 8. */
static void rti_sweep_part(const rt_motion *motion, double p[8][3], int part, int parts, double lo[3], double hi[3])
{
    const double step = (double)motion->angle / parts;
    double r[9], at[3];
    int end, i, k;
    for (end = part; end <= part + 1; end++) {
        const double time = (double)end / parts;
        rti_turn(motion, time, r);
        for (i = 0; i < 8; i++) {
            double off[3], stray;
            off[0] = p[i][0] - (double)motion->pivot.x;
            off[1] = p[i][1] - (double)motion->pivot.y;
            off[2] = p[i][2] - (double)motion->pivot.z;
            stray = sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]) * (step * step / 8 + 1e-14);
            at[0] = r[0] * off[0] + r[1] * off[1] + r[2] * off[2] + (double)motion->pivot.x + (double)motion->move.x * time;
            at[1] = r[3] * off[0] + r[4] * off[1] + r[5] * off[2] + (double)motion->pivot.y + (double)motion->move.y * time;
            at[2] = r[6] * off[0] + r[7] * off[1] + r[8] * off[2] + (double)motion->pivot.z + (double)motion->move.z * time;
            for (k = 0; k < 3; k++) {
                const double slack = stray + 1e-15 * fabs(at[k]);
                if (at[k] - slack < lo[k]) lo[k] = at[k] - slack;
                if (at[k] + slack > hi[k]) hi[k] = at[k] + slack;
            }
        }
    }
}

/* World bounds of what an instance shows, at all times, rounded outwards. */
static rti_box rti_instance_box(const rt_instance *instance)
{
    const float *const m = instance->transform, *const lower = instance->accel->outer_lower, *const upper = instance->accel->outer_upper;
    rti_box box = rti_empty_box;
    int i, j;
    for (i = 0; i < 3; i++) {
        double lo = (double)m[4 * i + 3], hi = lo, slack = fabs(lo);
        for (j = 0; j < 3; j++) {
            double a = (double)m[4 * i + j] * (double)lower[j], b = (double)m[4 * i + j] * (double)upper[j];
            lo += a < b ? a : b;
            hi += a < b ? b : a;
            slack += fabs(a) + fabs(b);
        }
        slack *= 1e-15;                     /* more than the double sums can have lost */
        box.lo[i] = rti_float_down(lo - slack);
        box.hi[i] = rti_float_up(hi + slack);
    }
    if (instance->motion) {                 /* the corners of the object, not of that box, which is larger */
        const rt_motion *motion = instance->motion;
        const int parts = 1 + (int)(fabsf(motion->angle) * 4);      /* of at most a quarter of a radian: 1 % of the circle too much */
        double p[8][3], lo[3], hi[3];
        for (i = 0; i < 3; i++) {
            lo[i] = (double)box.lo[i];
            hi[i] = (double)box.hi[i];
        }
        for (j = 0; j < 8; j++)
            for (i = 0; i < 3; i++)
                p[j][i] = (double)m[4 * i] * (double)(j & 1 ? upper : lower)[0] + (double)m[4 * i + 1] * (double)(j & 2 ? upper : lower)[1] +
                          (double)m[4 * i + 2] * (double)(j & 4 ? upper : lower)[2] + (double)m[4 * i + 3];
        for (j = 0; j < parts; j++) rti_sweep_part(motion, p, j, parts, lo, hi);
        for (i = 0; i < 3; i++) {
            const double slack = 4e-15 * (fabs(lo[i]) + fabs(hi[i]) + (double)fabsf(box.lo[i]) + (double)fabsf(box.hi[i]));
            box.lo[i] = rti_float_down(lo[i] - slack);
            box.hi[i] = rti_float_up(hi[i] + slack);
        }
    }
    return box;
}

#endif
#if RTI_IN(HOST)

#define RTI_NAME(name, text) text,
static const char *const rti_structure_names[] = { RT_STRUCTURE_LIST(RTI_NAME) "any" };     /* "any": RT_STRUCTURE_COUNT */

/* ---- >>validate ----------------------------------------------------------------------------------------------------- */

static const char rti_out_of_range[] = "is not finite or leaves +-RT_MAX_COORDINATE";

/* Bounds of primitive prim of geo. NULL: it is good; else what is wrong with it. A good one with an empty box cannot be hit. */
static const char *rti_prim_box(const rt_geometry *geo, size_t prim, rti_box *box, int *kind)
{
    int k;
    *box = rti_empty_box;
    *kind = RTI_TRIANGLE;
    if (prim < geo->triangle_count) {
        float v[12];
        if (!rti_fetch_triangle(geo, prim, v)) return "refers to a vertex that is not there";
        for (k = 0; k < 9; k++)
            if (!rti_coordinate_ok(v[k])) return rti_out_of_range;
        v[9] = v[10] = v[11] = 0;
        for (k = 0; k < 3; k++) rti_box_grow(box, v + 3 * k, v + 3 * k);
        return NULL;
    }
    prim -= geo->triangle_count;
#if RTI_SPHERES
    if (prim < geo->sphere_count) {
        const rt_sphere *s = &geo->spheres[prim];
        const float c[3] = { s->center.x, s->center.y, s->center.z };
        *kind = RTI_SPHERE;
        if (!(s->radius >= 0)) return "has a negative radius or one that is not a number";
        for (k = 0; k < 3; k++) {
            box->lo[k] = rti_float_down((double)c[k] - (double)s->radius);
            box->hi[k] = rti_float_up((double)c[k] + (double)s->radius);
            if (!rti_coordinate_ok(box->lo[k]) || !rti_coordinate_ok(box->hi[k])) return rti_out_of_range;
        }
        return NULL;
    }
    prim -= geo->sphere_count;
#endif
#if RTI_INSTANCES
    if (prim < geo->instance_count) {
        const rt_instance *instance = &geo->instances[prim];
        float inverse[12];
        *kind = RTI_INSTANCE;
        if (!instance->accel) return "has no accel";
        for (k = 0; k < 12; k++)
            if (!rti_coordinate_ok(instance->transform[k])) return rti_out_of_range;
        if (!rti_invert(instance->transform, inverse)) return "has a transform that cannot be inverted";
        if (instance->motion) {
            const rt_motion *m = instance->motion;
            const float numbers[] = { m->move.x, m->move.y, m->move.z, m->pivot.x, m->pivot.y, m->pivot.z, m->axis.x, m->axis.y, m->axis.z };
            for (k = 0; k < 9; k++)
                if (!rti_coordinate_ok(numbers[k])) return "has a motion that is not finite or leaves +-RT_MAX_COORDINATE";
            if (!(fabsf(m->angle) <= RT_MAX_ANGLE)) return "has a motion whose angle is not finite or above RT_MAX_ANGLE";
            if (m->angle != 0 && m->axis.x == 0 && m->axis.y == 0 && m->axis.z == 0) return "has a motion that turns about no axis";
        }
        if (rti_is_empty(instance->accel)) return NULL;
#if RTI_PLANES
        if (instance->accel->endless) return "shows an accel with an infinite plane, which has no bounds";
#endif
        *box = rti_instance_box(instance);
        for (k = 0; k < 3; k++)
            if (!rti_coordinate_ok(box->lo[k]) || !rti_coordinate_ok(box->hi[k])) return rti_out_of_range;
        return NULL;
    }
    prim -= geo->instance_count;
#endif
#if RTI_PLANES
    {
        const rt_plane *plane = &geo->planes[prim];
        const float point[3] = { plane->point.x, plane->point.y, plane->point.z };
        const float normal[3] = { plane->normal.x, plane->normal.y, plane->normal.z };
        *kind = RTI_PLANE;
        for (k = 0; k < 3; k++) {
            if (!rti_coordinate_ok(point[k])) return rti_out_of_range;
            if (!(fabsf(normal[k]) <= FLT_MAX)) return "has a normal that is not finite";
        }
        if (normal[0] == 0 && normal[1] == 0 && normal[2] == 0) return "has no normal";
        if (!(plane->radius >= 0 && plane->radius <= RT_MAX_COORDINATE)) return "has a radius that is negative, not finite or too large";
        for (k = 0; k < 3 && plane->radius > 0; k++) {
            box->lo[k] = rti_float_down((double)point[k] - (double)plane->radius);
            box->hi[k] = rti_float_up((double)point[k] + (double)plane->radius);
            if (!rti_coordinate_ok(box->lo[k]) || !rti_coordinate_ok(box->hi[k])) return rti_out_of_range;
        }
    }
#endif
    return NULL;
}

static rt_status rti_bad_prim(rt_error *error, const rt_geometry *geo, size_t prim)
{
    static const char *const names[] = { "triangle", "sphere", "instance", "", "plane" };
    rti_box box;
    int kind;
    const char *what = rti_prim_box(geo, prim, &box, &kind);
    size_t number = prim - (kind > RTI_TRIANGLE ? geo->triangle_count : 0) - (kind > RTI_SPHERE ? rti_sphere_count(geo) : 0) -
                    (kind > RTI_INSTANCE ? rti_instance_count(geo) : 0);
    return rti_fail(error, RT_ERROR_GEOMETRY, (uint32_t)prim, "%s %lu %s", names[kind], (unsigned long)number, what ? what : "");
}

/* What is wrong with the arguments themselves, before any primitive is read. */
static rt_status rti_check_geometry(const rt_geometry *geo, rt_error *error)
{
    size_t stride, total;
    if (!geo) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "geometry is NULL");
    stride = geo->vertex_stride;
    if (geo->triangle_count && geo->vertex_count && !geo->vertices)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "vertices is NULL but vertex_count is %lu", (unsigned long)geo->vertex_count);
    if (stride && (stride < 3 * sizeof(float) || stride % sizeof(float)))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "vertex_stride is %lu: it must be 0 or a multiple of 4 from 12 up",
                        (unsigned long)stride);
#if RTI_SPHERES
    if (geo->sphere_count && !geo->spheres)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "spheres is NULL but sphere_count is %lu", (unsigned long)geo->sphere_count);
#endif
#if RTI_INSTANCES
    if (geo->instance_count && !geo->instances)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "instances is NULL but instance_count is %lu",
                        (unsigned long)geo->instance_count);
#endif
#if RTI_PLANES
    if (geo->plane_count && !geo->planes)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "planes is NULL but plane_count is %lu", (unsigned long)geo->plane_count);
#endif
    total = geo->triangle_count;
    if (total <= RTI_MAX_PRIMS) total += rti_plane_count(geo) <= RTI_MAX_PRIMS ? rti_plane_count(geo) : RTI_MAX_PRIMS + 1;
    if (total <= RTI_MAX_PRIMS) total += rti_sphere_count(geo) <= RTI_MAX_PRIMS ? rti_sphere_count(geo) : RTI_MAX_PRIMS + 1;
    if (total <= RTI_MAX_PRIMS) total += rti_instance_count(geo) <= RTI_MAX_PRIMS ? rti_instance_count(geo) : RTI_MAX_PRIMS + 1;
    if (total > RTI_MAX_PRIMS)
        return rti_fail(error, RT_ERROR_LIMIT, RT_NONE, "more than %lu primitives in one accel", (unsigned long)RTI_MAX_PRIMS);
    return RT_OK;
}

#if RTI_KDTREE
/* Every node once, planes in their cells, leaves that name slots that are there, links and boxes right. */
static bool rti_kd_validate(const rt_accel *accel)
{
    struct { uint32_t node; int depth; float bounds[6]; } stack[RTI_MAX_DEPTH + 1];
    size_t visited = 1, references = 0;
    int top = 1, deepest = 0, k;
    stack[0].node = 0;
    stack[0].depth = 0;
    for (k = 0; k < 3; k++) {
        stack[0].bounds[k] = accel->lower[k];
        stack[0].bounds[3 + k] = accel->upper[k];
        if (!(accel->lower[k] <= accel->upper[k])) return false;
    }
    while (top) {
        const uint32_t at = stack[--top].node;
        const int depth = stack[top].depth;
        const rti_kdnode *node = &accel->kdnodes[at];
        const int axis = (int)(node->word & 3);
        const uint32_t first = axis == (int)RTI_LEAF ? node->word >> 2 : rti_kd_children(node);
        if (depth > RTI_MAX_DEPTH) return false;
        visited++;
        if (depth > deepest) deepest = depth;
        if (axis != (int)RTI_LEAF) {
            const float *bounds = stack[top].bounds;
            if (!(node->as.split >= bounds[axis] && node->as.split <= bounds[3 + axis])) return false;
            if (first < 2 || first + 1 >= accel->node_count || top + 2 > RTI_MAX_DEPTH + 1) return false;
            for (k = 0; k < 2; k++)
                if (rti_kd_empty(&accel->kdnodes[first + (uint32_t)k]) != !!(node->word & (k ? RTI_KD_UPPER_EMPTY : RTI_KD_LOWER_EMPTY)))
                    return false;
            if (accel->kdlinks && (accel->kdlinks[first / 2].parent != at || memcmp(accel->kdlinks[first / 2].bounds, bounds, 24)))
                return false;
            stack[top + 1] = stack[top];
            stack[top].node = first + 1;
            stack[top].bounds[axis] = node->as.split;
            stack[top++].depth = depth + 1;
            stack[top].node = first;
            stack[top].bounds[3 + axis] = node->as.split;
            stack[top++].depth = depth + 1;
            continue;
        }
        {
            const uint32_t kind = node->as.count >> RTI_KIND_SHIFT, count = node->as.count & RTI_COUNT_MASK;
            uint32_t i;
            if (count > 1 && (size_t)first + count > accel->kdslot_count) return false;
            for (i = 0; i < count; i++) {
                const uint32_t entry = count > 1 ? accel->kdslots[first + i] : kind << RTI_KIND_SHIFT | first, is = entry >> RTI_KIND_SHIFT;
                if (is >= RTI_KINDS || (entry & RTI_COUNT_MASK) >= accel->slots[is] || (kind != RTI_MIXED && is != kind)) return false;
                if (kind == RTI_MIXED && i && is < accel->kdslots[first + i - 1] >> RTI_KIND_SHIFT) return false;
            }
            references += count;
        }
    }
    return visited == accel->node_count && deepest == accel->depth && references == accel->references;
}
#endif

#if RTI_THREADED
static bool rti_threaded_validate(const rt_accel *accel);
#endif

#if RTI_WIDES
/* Every wide node and octet once, in the box that its parent has of it; as many primitives as there are. */
static bool rti_wide_validate(const rt_accel *accel)
{
    size_t inner = 1, octets = 0, seen[RTI_KINDS] = { 0, 0, 0 }, w;
    int i, k;
    for (w = 0; w < accel->wide_count; w++)
        for (i = 0; i < RTI_CHILDREN; i++) {
            const rti_wide *wide = &accel->wides[w];
            const uint32_t index = wide->index[i], kind = wide->count[i] >> RTI_KIND_SHIFT, count = wide->count[i] & RTI_COUNT_MASK;
            rti_box box = rti_empty_box;
            if (kind == RTI_KINDS) continue;
            if (kind > RTI_KINDS) return false;
            if (!wide->count[i]) {
                if (index <= w || index >= accel->wide_count) return false;
                box = rti_wide_bounds(&accel->wides[index]);
                inner++;
            } else if (kind == RTI_TRIANGLE && accel->octets) {
                uint32_t j;
                if (index >= accel->octet_count || count < 1 || count > RTI_CHILDREN) return false;
                for (j = count; j < RTI_CHILDREN; j++)
                    if (accel->octets[index].prim[j] != accel->octets[index].prim[0]) return false;
                box = rti_octet_bounds(&accel->octets[index]);
                octets++;
            } else if (!count || (size_t)index + count > accel->slots[kind]) return false;
            for (k = 0; k < 3; k++)
                if (box.lo[k] < wide->bounds[k][i] || box.hi[k] > wide->bounds[3 + k][i]) return false;
            seen[kind] += count;
        }
    for (k = 0; k < RTI_KINDS; k++)
        if (seen[k] != accel->slots[k]) return false;
    return inner == accel->wide_count && (!accel->octets || octets == accel->octet_count);
}
#endif

/* Walks the tree and checks every invariant the traversals rely on; the tests call it after each build and refit. */
RTI_NOINLINE bool rti_validate(const rt_accel *accel)
{
    size_t seen[RTI_KINDS] = { 0, 0, 0 }, visited = 0;
    struct { uint32_t node; int depth; } stack[RTI_MAX_DEPTH + 1];
    int top = 0, deepest = 0, k;
    if (!accel->node_count) return accel->slots[0] + accel->slots[1] + accel->slots[2] == 0;
#if RTI_KDTREE
    if (accel->structure == RT_KDTREE) return rti_kd_validate(accel);
#endif
#if RTI_THREADED
    if (accel->structure == RT_THREADED) return rti_threaded_validate(accel);
#endif
#if RTI_WIDES
    if (accel->wides && !rti_wide_validate(accel)) return false;
    if (rti_only_wide(accel)) return true;
#endif
    stack[top].node = 0;
    stack[top++].depth = 0;
    while (top) {
        const rti_node *node;
        int depth = stack[--top].depth;
        uint32_t at = stack[top].node;
        if (at >= accel->node_count || depth > RTI_MAX_DEPTH) return false;
        node = &accel->nodes[at];
        visited++;
        if (depth > deepest) deepest = depth;
        for (k = 0; k < 3; k++)
            if (!(node->bounds[k] <= node->bounds[3 + k])) return false;
        if (node->count) {
            int kind = rti_leaf_kind(node);
            if (kind >= RTI_KINDS || node->index != seen[kind]) return false;           /* slots in depth-first order */
            seen[kind] += rti_leaf_count(node);
            continue;
        }
        if (node->index <= at || node->index >= accel->node_count - 1 || top + 2 > RTI_MAX_DEPTH + 1) return false;
        for (k = 0; k < 6; k++) {
            const rti_node *child = &accel->nodes[node->index + (uint32_t)(k & 1)];
            if (child->bounds[k / 2] < node->bounds[k / 2] || child->bounds[3 + k / 2] > node->bounds[3 + k / 2]) return false;
        }
        stack[top].node = node->index + 1;
        stack[top++].depth = depth + 1;
        stack[top].node = node->index;
        stack[top++].depth = depth + 1;
    }
    for (k = 0; k < RTI_KINDS; k++)
        if (seen[k] != accel->slots[k]) return false;
    return visited == accel->node_count && deepest == accel->depth;
}

/* ---- >>refs --------------------------------------------------------------------------------------------------------- */

/* One primitive while building. */
typedef struct { float lo[3]; uint32_t prim; float hi[3]; uint32_t kind; } rti_ref;

#define RTI_CHUNK ((size_t)1 << 15)          /* refs that one call of a parallel_for's body looks at */
static size_t rti_chunk_total(size_t count) { return (count + RTI_CHUNK - 1) / RTI_CHUNK; }

static void rti_for(rt_parallel_for parallel_for, void *user, size_t count, void (*body)(void *context, size_t index), void *context)
{
    if (parallel_for && count > 1) parallel_for(user, count, body, context);
    else {
        size_t i;
        for (i = 0; i < count; i++) body(context, i);
    }
}

typedef struct {
    const rt_geometry *geo;
    rti_ref *refs;
    size_t total;
    size_t *bad;                            /* first bad primitive of each chunk, or total */
    size_t *bad_count;                      /* bad primitives of each chunk, */
    size_t *left_out;                       /* and those that are bad or empty */
} rti_gather;

static void rti_gather_chunk(void *context, size_t chunk)
{
    rti_gather *g = (rti_gather *)context;
    size_t i = chunk * RTI_CHUNK, end = g->total - i < RTI_CHUNK ? g->total : i + RTI_CHUNK;
    g->bad[chunk] = g->total;
    g->bad_count[chunk] = g->left_out[chunk] = 0;
    for (; i < end; i++) {
        rti_ref *ref = &g->refs[i];
        rti_box box;
        int kind;
        bool good = rti_prim_box(g->geo, i, &box, &kind) == NULL;
        memcpy(ref->lo, box.lo, sizeof ref->lo);
        memcpy(ref->hi, box.hi, sizeof ref->hi);
        ref->kind = (uint32_t)kind;
        ref->prim = good && box.lo[0] <= box.hi[0] ? (uint32_t)i : RT_NONE;
        if (ref->prim == RT_NONE) g->left_out[chunk]++;
        if (!good && !g->bad_count[chunk]++) g->bad[chunk] = i;
    }
}

/* Checks all primitives, in parallel, and makes a ref of each that is good and not empty: *refs, to be released also on failure. */
static rt_status rti_gather_refs(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt, rti_ref **refs, size_t *count)
{
    size_t total = rti_tree_count(geo), chunks = rti_chunk_total(total), i, out = 0;
    rti_gather gather;
    rt_status status = RT_OK;
    gather.geo = geo;
    gather.total = total;
    gather.refs = *refs = (rti_ref *)rti_alloc(total, sizeof(rti_ref), opt->memory_user);
    gather.bad = (size_t *)rti_alloc(chunks, 3 * sizeof(size_t), opt->memory_user);
    if (!gather.refs || !gather.bad) status = RT_ERROR_MEMORY;
    else {
        gather.bad_count = gather.bad + chunks;
        gather.left_out = gather.bad_count + chunks;
        rti_for(opt->parallel_for, opt->parallel_user, chunks, rti_gather_chunk, &gather);
        for (i = 0; i < chunks && status == RT_OK; i++) {
            if (gather.bad[i] < total && !opt->skip_invalid) status = rti_bad_prim(opt->error, geo, gather.bad[i]);
            accel->skipped += gather.bad_count[i];
            out += gather.left_out[i];
        }
        if (out) {                          /* close the gaps */
            size_t left = 0;
            for (i = 0; i < total; i++)
                if (gather.refs[i].prim != RT_NONE) gather.refs[left++] = gather.refs[i];
        }
        *count = total - out;
    }
    rti_release(gather.bad, opt->memory_user);
    return status;
}

/* ---- >>accel -------------------------------------------------------------------------------------------------------- */

/* What an accel holds, whatever its tree. */

static void rti_set_root(rt_accel *accel)
{
    int k;
    for (k = 0; k < 3; k++) {
        accel->lower[k] = accel->nodes ? accel->nodes[0].bounds[k] : RTI_INFINITY;
        accel->upper[k] = accel->nodes ? accel->nodes[0].bounds[3 + k] : -RTI_INFINITY;
    }
#if RTI_WIDES
    if (rti_only_wide(accel)) {
        const rti_box box = rti_wide_bounds(&accel->wides[0]);
        memcpy(accel->lower, box.lo, sizeof accel->lower);
        memcpy(accel->upper, box.hi, sizeof accel->upper);
    }
#endif
}

/* Slot contents from geo; prim ids are in place. */
RTI_INLINE void rti_fill_triangle(rti_triangle *t, const rt_geometry *geo) { (void)rti_fetch_triangle(geo, t->prim, t->v); }

#if RTI_SPHERES
RTI_INLINE void rti_fill_ball(rti_ball *ball, const rt_geometry *geo)
{
    const rt_sphere *s = &geo->spheres[ball->prim - geo->triangle_count];
    ball->center[0] = s->center.x;
    ball->center[1] = s->center.y;
    ball->center[2] = s->center.z;
    ball->radius = s->radius;
}
#endif

#if RTI_INSTANCES
static void rti_fill_instance(rti_instance *i, const rt_geometry *geo)
{
    const rt_instance *from = &geo->instances[i->prim - geo->triangle_count - rti_sphere_count(geo)];
    i->accel = from->accel;
    memcpy(i->transform, from->transform, sizeof i->transform);
    (void)rti_invert(i->transform, i->inverse);
    i->moves = from->motion != NULL;
    if (from->motion) i->motion = *from->motion;
}
#endif

#if RTI_PLANES
static void rti_fill_plane(rti_ground *plane, const rt_geometry *geo)
{
    const rt_plane *from = &geo->planes[plane->prim - rti_tree_count(geo)];
    plane->point[0] = from->point.x;
    plane->point[1] = from->point.y;
    plane->point[2] = from->point.z;
    plane->normal[0] = from->normal.x;
    plane->normal[1] = from->normal.y;
    plane->normal[2] = from->normal.z;
    plane->radius = from->radius;
}

/* The good ones of geo; answers how many are bad. */
static size_t rti_fill_planes(rt_accel *accel, const rt_geometry *geo)
{
    size_t i, bad = 0;
    accel->plane_count = 0;
    accel->endless = false;
    for (i = 0; i < geo->plane_count; i++) {
        rti_ground *to = &accel->planes[accel->plane_count];
        const size_t prim = rti_tree_count(geo) + i;
        rti_box box;
        int kind;
        if (rti_prim_box(geo, prim, &box, &kind)) {
            bad++;
            continue;
        }
        to->prim = (uint32_t)prim;
        rti_fill_plane(to, geo);
        if (!(to->radius > 0)) accel->endless = true;
        accel->plane_count++;
    }
    return bad;
}

static rt_status rti_build_planes(rt_accel *accel, const rt_geometry *geo, bool skip_invalid, rt_error *error)
{
    size_t i;
    if (!geo->plane_count) return RT_OK;
    for (i = 0; i < geo->plane_count && !skip_invalid; i++) {
        rti_box box;
        int kind;
        if (rti_prim_box(geo, rti_tree_count(geo) + i, &box, &kind)) return rti_bad_prim(error, geo, rti_tree_count(geo) + i);
    }
    accel->planes = (rti_ground *)rti_alloc(geo->plane_count, sizeof *accel->planes, accel->memory_user);
    if (!accel->planes) return RT_ERROR_MEMORY;
    accel->bytes += geo->plane_count * sizeof *accel->planes;
    accel->skipped += rti_fill_planes(accel, geo);
    return RT_OK;
}
#endif

/* How far, beyond its own box, rounding can carry a hit inside an instance: a ray from o errs by at most 2^-24 spread (|o| + extent) in
   world space, see rti_prepare. Through one instance M the transformed origin and direction err by 2 units of 2^-24 each, stretched by C
   = |M| |M^-1|; the child's own error (16 units of |o'| + extent', plus its spread) comes back stretched too. The child's underflows, of
   the order of 1e-37, are stretched as well: counting at least 1e-31 as its extent covers them (2^-24 * 40 C * 2e-31 > 1e-37). A motion
   rounds once more, and its rotation stretches the largest coordinate by up to sqrt(3) each way, move and pivot counting as
   coordinates: 4 C, and 8 of what is largest, cover it. */
static void rti_set_reach(rt_accel *accel)
{
    int k;
    accel->extent = accel->spread = 0;
    accel->nesting = 0;
    for (k = 0; k < 3; k++) {
        accel->outer_lower[k] = accel->lower[k];
        accel->outer_upper[k] = accel->upper[k];
    }
#if RTI_PLANES
    {
        size_t i;
        for (i = 0; i < accel->plane_count; i++) {
            const rti_ground *plane = &accel->planes[i];
            for (k = 0; k < 3 && plane->radius > 0; k++) {
                const float lo = rti_float_down((double)plane->point[k] - (double)plane->radius);
                const float hi = rti_float_up((double)plane->point[k] + (double)plane->radius);
                if (lo < accel->outer_lower[k]) accel->outer_lower[k] = lo;
                if (hi > accel->outer_upper[k]) accel->outer_upper[k] = hi;
            }
        }
    }
#endif
    for (k = 0; k < 3 && accel->outer_lower[k] <= accel->outer_upper[k]; k++) {
        float m = fabsf(accel->outer_lower[k]) > fabsf(accel->outer_upper[k]) ? fabsf(accel->outer_lower[k]) : fabsf(accel->outer_upper[k]);
        if (m > accel->extent) accel->extent = m;
    }
#if RTI_INSTANCES
    {
        size_t i;
        accel->moves = false;
        for (i = 0; i < accel->slots[RTI_INSTANCE]; i++) {
            const rti_instance *in = &accel->instances[i];
            double stretch = rti_stretch(in->transform), c = stretch * rti_stretch(in->inverse);
            double extent = stretch * ((double)in->accel->extent + 1e-31), spread = c * (40 + 2 * (double)in->accel->spread);
            for (k = 0; k < 3; k++)
                if (extent < fabs((double)in->transform[4 * k + 3])) extent = fabs((double)in->transform[4 * k + 3]);
            extent *= 2;                    /* stretch * child + |translation| */
            if (in->moves) {
                const rt_motion *m = &in->motion;
                const float moves[] = { m->move.x, m->move.y, m->move.z, m->pivot.x, m->pivot.y, m->pivot.z };
                for (k = 0; k < 6; k++)
                    if (extent < fabs((double)moves[k])) extent = fabs((double)moves[k]);
                extent *= 8;
                spread = 4 * (spread + 8 * c);
            }
            if (in->moves || in->accel->moves) accel->moves = true;
            if (extent > (double)accel->extent) accel->extent = rti_float_up(extent);
            if (spread > (double)accel->spread) accel->spread = spread < 1e30 ? rti_float_up(spread) : 1e30f;
            if (in->accel->nesting + 1 > accel->nesting) accel->nesting = in->accel->nesting + 1;
        }
    }
#endif
}

static void rti_free_accel(rt_accel *accel)
{
    void *user = accel->memory_user;
    rti_release(accel->nodes, user);
#if RTI_WIDES
    rti_release(accel->wide_memory, user);
#endif
#if RTI_KDTREE
    rti_release(accel->kdnodes, user);
    rti_release(accel->kdlinks, user);
    rti_release(accel->kdslots, user);
#endif
#if RTI_THREADED
    rti_release(accel->links, user);
    rti_release(accel->instance_nodes, user);
#endif
    rti_release(accel->triangles, user);
    rti_release(accel->triangle_ids, user);
#if RTI_SPHERES
    rti_release(accel->balls, user);
    rti_release(accel->ball_ids, user);
#endif
#if RTI_PLANES
    rti_release(accel->planes, user);
#endif
#if RTI_INSTANCES
    rti_release(accel->instances, user);
    rti_release(accel->instance_slots, user);
    rti_release(accel->instance_bases, user);
#endif
    rti_release(accel, user);
}

/* Names every instance: base_0 = 0, base_(j+1) = base_j + 1 + paths(child_j). wide: may they show accels of wide nodes alone? */
static rt_status rti_number_instances(rt_accel *accel, const rt_geometry *geo, bool wide, rt_error *error)
{
#if RTI_INSTANCES
    uint64_t next = 0;
    size_t i, n = geo->instance_count;
    if (!n) return RT_OK;
    accel->instance_slots = (uint32_t *)rti_alloc(n, sizeof(uint32_t), accel->memory_user);
    accel->instance_bases = (uint32_t *)rti_alloc(n, sizeof(uint32_t), accel->memory_user);
    if (!accel->instance_slots || !accel->instance_bases) return rti_fail(error, RT_ERROR_MEMORY, RT_NONE, "out of memory");
    accel->bytes += 2 * n * sizeof(uint32_t);
    for (i = 0; i < n; i++) {
        const rt_accel *child = geo->instances[i].accel;
        accel->instance_slots[i] = RT_NONE;
        accel->instance_bases[i] = (uint32_t)next;
        if (child && child->nesting + 1 > RT_MAX_NESTING)
            return rti_fail(error, RT_ERROR_LIMIT, (uint32_t)(geo->triangle_count + rti_sphere_count(geo) + i),
                            "instance %lu nests deeper than RT_MAX_NESTING (%d)", (unsigned long)i, RT_MAX_NESTING);
        if (child && rti_only_wide(child) && !wide)
            return rti_fail(error, RT_ERROR_ARGUMENT, (uint32_t)(geo->triangle_count + rti_sphere_count(geo) + i),
                            "instance %lu shows an accel built with no_binary: what holds it must be a bvh built so too", (unsigned long)i);
        next += 1 + (child ? (uint64_t)child->paths : 0);
        if (next >= RT_NONE) return rti_fail(error, RT_ERROR_LIMIT, RT_NONE, "more paths through nested instances than 32 bits can number");
    }
    accel->paths = (uint32_t)next;
#else
    (void)accel, (void)geo, (void)wide, (void)error;
#endif
    return RT_OK;
}

/* prims: of slots in order, stride apart; NULL: they are in place. */
typedef struct { rt_accel *accel; const rt_geometry *geo; const uint32_t *prims; size_t stride; } rti_fill;

static void rti_fill_chunk(void *context, size_t chunk)
{
    const rti_fill *fill = (const rti_fill *)context;
    const rt_accel *accel = fill->accel;
    size_t i = chunk * RTI_CHUNK, n = accel->slots[RTI_TRIANGLE], end = n - i < RTI_CHUNK ? n : i + RTI_CHUNK;
    for (; i < end; i++) {
        if (accel->triangle_ids) accel->triangle_ids[i] = fill->prims[i * fill->stride];
        else {
            if (fill->prims) accel->triangles[i].prim = fill->prims[i * fill->stride];
            rti_fill_triangle(&accel->triangles[i], fill->geo);
        }
    }
}

/* Allocates the arrays of each kind and fills them with prims[0], prims[stride], ... which stand in leaf order. */
static bool rti_fill_slots(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt, const uint32_t *prims, size_t stride,
                           size_t count)
{
    const bool reference = opt->reference;
    void *user = accel->memory_user;
    const bool mixed = rti_sphere_count(geo) || rti_instance_count(geo);
    size_t i, next[RTI_KINDS] = { 0, 0, 0 };
    rti_fill fill;
    if (!mixed) accel->slots[RTI_TRIANGLE] = count;
    for (i = 0; i < count && mixed; i++) accel->slots[rti_kind_of(geo, prims[i * stride])]++;
    if (reference) accel->triangle_ids = (uint32_t *)rti_alloc(accel->slots[RTI_TRIANGLE], sizeof(uint32_t), user);
    else accel->triangles = (rti_triangle *)rti_alloc(accel->slots[RTI_TRIANGLE], sizeof(rti_triangle), user);
    if (!accel->triangles && !accel->triangle_ids) return false;
    accel->bytes += accel->slots[RTI_TRIANGLE] * (reference ? sizeof(uint32_t) : sizeof(rti_triangle));
#if RTI_SPHERES
    if (accel->slots[RTI_SPHERE]) {
        if (reference) accel->ball_ids = (uint32_t *)rti_alloc(accel->slots[RTI_SPHERE], sizeof(uint32_t), user);
        else accel->balls = (rti_ball *)rti_alloc(accel->slots[RTI_SPHERE], sizeof(rti_ball), user);
        if (!accel->balls && !accel->ball_ids) return false;
        accel->bytes += accel->slots[RTI_SPHERE] * (reference ? sizeof(uint32_t) : sizeof(rti_ball));
    }
#endif
#if RTI_INSTANCES
    if (accel->slots[RTI_INSTANCE]) {
        accel->instances = (rti_instance *)rti_alloc(accel->slots[RTI_INSTANCE], sizeof(rti_instance), user);
        if (!accel->instances) return false;
        accel->bytes += accel->slots[RTI_INSTANCE] * sizeof(rti_instance);
    }
#endif
    for (i = 0; i < count && mixed; i++) {  /* leaves of one kind stand in ref order: slots count up */
        uint32_t prim = prims[i * stride];
        int kind = rti_kind_of(geo, prim);
        size_t slot = next[kind]++;
        switch (kind) {
        case RTI_TRIANGLE:
            if (reference) accel->triangle_ids[slot] = prim;
            else accel->triangles[slot].prim = prim;
            break;
#if RTI_SPHERES
        case RTI_SPHERE:
            if (reference) accel->ball_ids[slot] = prim;
            else {
                accel->balls[slot].prim = prim;
                rti_fill_ball(&accel->balls[slot], geo);
            }
            break;
#endif
#if RTI_INSTANCES
        case RTI_INSTANCE: {
            size_t number = prim - geo->triangle_count - rti_sphere_count(geo);
            accel->instances[slot].prim = prim;
            accel->instances[slot].base = accel->instance_bases[number];
            accel->instance_slots[number] = (uint32_t)slot;
            rti_fill_instance(&accel->instances[slot], geo);
            break;
        }
#endif
        default: break;
        }
    }
    if (!reference || !mixed) {
        fill.accel = accel;
        fill.geo = geo;
        fill.prims = mixed ? NULL : prims;
        fill.stride = stride;
        rti_for(opt->parallel_for, opt->parallel_user, rti_chunk_total(accel->slots[RTI_TRIANGLE]), rti_fill_chunk, &fill);
    }
    return true;
}

/* ---- >>bins --------------------------------------------------------------------------------------------------------- */

#if RTI_BVH || RTI_THREADED             /* threaded trees are BVHs first */

/* Four floats side by side: x, y, z and one that does not matter, which in boxes of refs is a number. The same bits from SSE2 as from plain
   C, so that the trees are the same. */
#if RTI_X86
typedef __m128 rti_quad;
RTI_INLINE rti_quad rti_qload(const float *p) { return _mm_loadu_ps(p); }
RTI_INLINE void rti_qstore(float *p, rti_quad a) { _mm_storeu_ps(p, a); }
RTI_INLINE rti_quad rti_qset(float x) { return _mm_set1_ps(x); }
RTI_INLINE rti_quad rti_qmin(rti_quad a, rti_quad b) { return _mm_min_ps(a, b); }
RTI_INLINE rti_quad rti_qmax(rti_quad a, rti_quad b) { return _mm_max_ps(a, b); }
RTI_INLINE rti_quad rti_qadd(rti_quad a, rti_quad b) { return _mm_add_ps(a, b); }
RTI_INLINE rti_quad rti_qsub(rti_quad a, rti_quad b) { return _mm_sub_ps(a, b); }
RTI_INLINE rti_quad rti_qmul(rti_quad a, rti_quad b) { __m128 c = _mm_mul_ps(a, b); RTI_ROUND(c); return c; }
RTI_INLINE rti_quad rti_qxyz(rti_quad a) { return _mm_and_ps(a, _mm_castsi128_ps(_mm_set_epi32(0, -1, -1, -1))); }
RTI_INLINE rti_quad rti_qcounts(const uint32_t *p) { return _mm_cvtepi32_ps(_mm_loadu_si128((const __m128i *)(const void *)p)); }
RTI_INLINE rti_quad rti_qless(rti_quad a, rti_quad b, rti_quad yes, rti_quad no)           /* a < b ? yes : no */
{
    const __m128 less = _mm_cmplt_ps(a, b);
    return _mm_or_ps(_mm_and_ps(less, yes), _mm_andnot_ps(less, no));
}
RTI_INLINE void rti_qtrunc(rti_quad a, uint32_t xyz[3])                                    /* of numbers from 0 to 65535 */
{
    const __m128i i = _mm_cvttps_epi32(a);
    xyz[0] = (uint32_t)_mm_cvtsi128_si32(i);
    xyz[1] = (uint32_t)_mm_extract_epi16(i, 2);
    xyz[2] = (uint32_t)_mm_extract_epi16(i, 4);
}
RTI_INLINE rti_quad rti_qyzx(rti_quad a) { return _mm_shuffle_ps(a, a, _MM_SHUFFLE(3, 0, 2, 1)); }
RTI_INLINE float rti_qsum(rti_quad a)                                                      /* x + y + z */
{
    return _mm_cvtss_f32(_mm_add_ss(_mm_add_ss(a, _mm_shuffle_ps(a, a, 1)), _mm_movehl_ps(a, a)));
}
RTI_INLINE bool rti_qsame(rti_quad a, rti_quad b) { return (_mm_movemask_ps(_mm_cmpneq_ps(a, b)) & 7) == 0; }
RTI_INLINE void rti_qturn(rti_quad a[3])                                                   /* rows to columns */
{
    const __m128 xy = _mm_unpacklo_ps(a[0], a[1]), z = _mm_unpackhi_ps(a[0], a[1]);
    a[0] = _mm_shuffle_ps(xy, a[2], _MM_SHUFFLE(0, 0, 1, 0));
    a[1] = _mm_shuffle_ps(xy, a[2], _MM_SHUFFLE(1, 1, 3, 2));
    a[2] = _mm_shuffle_ps(z, a[2], _MM_SHUFFLE(2, 2, 1, 0));
}
#else
typedef struct { float f[4]; } rti_quad;
RTI_INLINE rti_quad rti_qof(float x, float y, float z) { rti_quad q; q.f[0] = x, q.f[1] = y, q.f[2] = z, q.f[3] = 0; return q; }
#define RTI_QEACH(a, op, b) rti_qof(a.f[0] op b.f[0], a.f[1] op b.f[1], a.f[2] op b.f[2])
#define RTI_QPICK(a, op, b, yes, no) rti_qof(a.f[0] op b.f[0] ? yes.f[0] : no.f[0], a.f[1] op b.f[1] ? yes.f[1] : no.f[1], \
                                             a.f[2] op b.f[2] ? yes.f[2] : no.f[2])
RTI_INLINE rti_quad rti_qload(const float *p) { rti_quad q; memcpy(q.f, p, sizeof q.f); return q; }
RTI_INLINE void rti_qstore(float *p, rti_quad a) { memcpy(p, a.f, sizeof a.f); }
RTI_INLINE rti_quad rti_qset(float x) { return rti_qof(x, x, x); }
RTI_INLINE rti_quad rti_qmin(rti_quad a, rti_quad b) { return RTI_QPICK(a, <, b, a, b); }
RTI_INLINE rti_quad rti_qmax(rti_quad a, rti_quad b) { return RTI_QPICK(a, >, b, a, b); }
RTI_INLINE rti_quad rti_qadd(rti_quad a, rti_quad b) { return RTI_QEACH(a, +, b); }
RTI_INLINE rti_quad rti_qsub(rti_quad a, rti_quad b) { return RTI_QEACH(a, -, b); }
RTI_INLINE rti_quad rti_qmul(rti_quad a, rti_quad b)
{
    return rti_qof(rti_keepf(a.f[0] * b.f[0]), rti_keepf(a.f[1] * b.f[1]), rti_keepf(a.f[2] * b.f[2]));
}
RTI_INLINE rti_quad rti_qxyz(rti_quad a) { return a; }
RTI_INLINE rti_quad rti_qcounts(const uint32_t *p) { return rti_qof((float)(int32_t)p[0], (float)(int32_t)p[1], (float)(int32_t)p[2]); }
RTI_INLINE rti_quad rti_qless(rti_quad a, rti_quad b, rti_quad yes, rti_quad no) { return RTI_QPICK(a, <, b, yes, no); }
RTI_INLINE void rti_qtrunc(rti_quad a, uint32_t xyz[3])
{
    int k;
    for (k = 0; k < 3; k++) xyz[k] = (uint32_t)a.f[k];
}
RTI_INLINE rti_quad rti_qyzx(rti_quad a) { return rti_qof(a.f[1], a.f[2], a.f[0]); }
RTI_INLINE float rti_qsum(rti_quad a) { return a.f[0] + a.f[1] + a.f[2]; }
RTI_INLINE bool rti_qsame(rti_quad a, rti_quad b) { return a.f[0] == b.f[0] && a.f[1] == b.f[1] && a.f[2] == b.f[2]; }
RTI_INLINE void rti_qturn(rti_quad a[3])
{
    const rti_quad x = a[0], y = a[1], z = a[2];
    a[0] = rti_qof(x.f[0], y.f[0], z.f[0]);
    a[1] = rti_qof(x.f[1], y.f[1], z.f[1]);
    a[2] = rti_qof(x.f[2], y.f[2], z.f[2]);
}
#endif

/* A box while it grows, in registers. */
typedef struct { rti_quad lo, hi; } rti_hull;

RTI_INLINE rti_hull rti_hull_of(const rti_box *box)
{
    rti_hull s;
    s.lo = rti_qload(box->lo);
    s.hi = rti_qload(box->hi);
    return s;
}
RTI_INLINE void rti_hull_grow(rti_hull *s, const float *lo, const float *hi)
{
    s->lo = rti_qmin(s->lo, rti_qload(lo));
    s->hi = rti_qmax(s->hi, rti_qload(hi));
}
RTI_INLINE void rti_hull_put(rti_box *box, const rti_hull *s)
{
    rti_qstore(box->lo, s->lo);
    rti_qstore(box->hi, s->hi);
}

/* Twice the centroid. Fourth lanes, numbers of primitives, would be slow as floats. */
RTI_INLINE rti_quad rti_centroid(const rti_ref *ref) { return rti_qxyz(rti_qadd(rti_qload(ref->lo), rti_qload(ref->hi))); }

#define RTI_MAX_BINS 32
#define RTI_RANKED   8                      /* up to so many refs have a bin each */
typedef struct { rti_box box[3][RTI_MAX_BINS]; uint32_t count[RTI_MAX_BINS][4]; } rti_bins;

/* Bins of lo + hi, twice the centroid: bin = (lo + hi - origin) * scale. A scale of 0 marks an axis that cannot be split. */
typedef struct { float origin[4], scale[4]; int bins; } rti_binning;

/* The first bin on the right, of so many refs on the left; the cost is area * refs on the left and on the right, areas being those of all
   made larger by unit squared. */
typedef struct { int axis, bin; float cost, unit; size_t left_count; } rti_split;

static rti_binning rti_make_binning(const rti_box *centroids, int bins)
{
    rti_binning b;
    int k;
    b.bins = bins;
    b.origin[3] = b.scale[3] = 0;
    for (k = 0; k < 3; k++) {
        float extent = centroids->hi[k] - centroids->lo[k];
        b.origin[k] = centroids->lo[k];
        b.scale[k] = extent > 1e-34f ? (float)bins / extent : 0;        /* below, the quotient could overflow */
    }
    return b;
}

RTI_INLINE void rti_bins_clear(rti_bins *bins, int count)
{
    const rti_hull empty = rti_hull_of(&rti_empty_box);
    int axis, i;
    for (axis = 0; axis < 3; axis++)
        for (i = 0; i < count; i++) rti_hull_put(&bins->box[axis][i], &empty);
    memset(bins->count, 0, (size_t)count * sizeof bins->count[0]);
}

RTI_INLINE void rti_bins_add(rti_bins *bins, const rti_binning *b, const rti_ref *ref)
{
    const rti_quad lo = rti_qload(ref->lo), hi = rti_qload(ref->hi), at = rti_qsub(rti_qxyz(rti_qadd(lo, hi)), rti_qload(b->origin));
    uint32_t bin[3];
    int axis;
    rti_qtrunc(rti_qmin(rti_qmul(at, rti_qload(b->scale)), rti_qset((float)(b->bins - 1))), bin);
    RTI_UNROLL
    for (axis = 0; axis < 3; axis++) {
        rti_box *box = &bins->box[axis][bin[axis]];
        rti_qstore(box->lo, rti_qmin(lo, rti_qload(box->lo)));
        rti_qstore(box->hi, rti_qmax(hi, rti_qload(box->hi)));
        bins->count[bin[axis]][axis]++;
    }
}

/* Neighbours mostly fall into one bin and would wait for each other's stores: so refs come from both halves by turns. */
RTI_INLINE void rti_bins_fill(rti_bins *bins, const rti_binning *b, const rti_ref *refs, size_t count)
{
    const rti_binning at = *b;              /* out of reach of those stores */
    const size_t half = count / 2;
    size_t i;
    for (i = 0; i < half; i++) {
        rti_bins_add(bins, &at, &refs[i]);
        rti_bins_add(bins, &at, &refs[half + i]);
    }
    if (count & 1) rti_bins_add(bins, &at, &refs[count - 1]);
}

/* A bin for each of at most RTI_RANKED refs: the one that tells how many centroids are below its own. So every plane between refs is tried. */
RTI_INLINE void rti_bins_rank(rti_bins *bins, const rti_ref *refs, size_t count)
{
#if RTI_X86
    __m128 centroid[RTI_RANKED];
    __m128i rank[RTI_RANKED];
#else
    rti_quad centroid[RTI_RANKED];
#endif
    uint32_t ranks[RTI_RANKED][4];
    size_t i, j;
    int axis;
#if RTI_X86
    for (i = 0; i < count; i++) {
        const __m128 c = centroid[i] = rti_centroid(&refs[i]);
        __m128i at = _mm_set1_epi32((int)i);
        for (j = 0; j < i; j++) {
            const __m128i below = _mm_castps_si128(_mm_cmplt_ps(c, centroid[j]));
            at = _mm_add_epi32(at, below);
            rank[j] = _mm_sub_epi32(rank[j], below);
        }
        rank[i] = at;
    }
    for (i = 0; i < count; i++) _mm_storeu_si128((__m128i *)(void *)ranks[i], rank[i]);
#else
    for (i = 0; i < count; i++) {
        centroid[i] = rti_centroid(&refs[i]);
        for (axis = 0; axis < 3; axis++) {
            ranks[i][axis] = (uint32_t)i;
            for (j = 0; j < i; j++) {
                const bool below = centroid[i].f[axis] < centroid[j].f[axis];
                ranks[i][axis] -= below;
                ranks[j][axis] += below;
            }
        }
    }
#endif
    for (i = 0; i < count; i++) {
        const rti_quad lo = rti_qload(refs[i].lo), hi = rti_qload(refs[i].hi);
        RTI_UNROLL
        for (axis = 0; axis < 3; axis++) {
            rti_box *box = &bins->box[axis][ranks[i][axis]];
            rti_qstore(box->lo, lo);
            rti_qstore(box->hi, hi);
        }
    }
}

static void rti_bins_merge(rti_bins *bins, const rti_bins *more, int count)
{
    int axis, i;
    for (axis = 0; axis < 3; axis++)
        for (i = 0; i < count; i++) {
            rti_box_grow(&bins->box[axis][i], more->box[axis][i].lo, more->box[axis][i].hi);
            bins->count[i][axis] += more->count[i][axis];
        }
}

/* A power of 2 that brings the largest side of box near 1, so that areas and costs stay floats; 1 of a point. */
RTI_INLINE float rti_unit_of(const rti_box *box)
{
    float side = 0, unit;
    uint32_t bits;
    int k;
    for (k = 0; k < 3; k++) side = rti_maxf(box->hi[k] - box->lo[k], side);
    memcpy(&bits, &side, sizeof bits);
    bits = side > 1e-37f ? (254u << 23) - (bits & 0xffu << 23) : 127u << 23;
    memcpy(&unit, &bits, sizeof unit);
    return unit;
}

/* Half the surfaces of three boxes. */
RTI_INLINE rti_quad rti_half_areas(const rti_hull s[3], rti_quad unit)
{
    rti_quad d[3];
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) d[k] = rti_qmul(rti_qsub(s[k].hi, s[k].lo), unit);
    rti_qturn(d);
    return rti_qadd(rti_qmul(rti_qadd(d[0], d[1]), d[2]), rti_qmul(d[0], d[1]));
}

/* Least of area * count over all planes between bins, on the three axes side by side: right costs from the right, then left costs against
   them. The first and the last bin of an axis that can be split hold something, so both sides of a plane do. ranked: bins hold one ref
   each. */
RTI_INLINE bool rti_best_split(const rti_bins *bins, int count, const float may[3], bool ranked, rti_split *best)
{
    const rti_quad unit = rti_qset(best->unit);
    rti_quad right[RTI_MAX_BINS], least = rti_qset(RTI_INFINITY), where = rti_qset(0);
    rti_hull s[3];
    float costs[4], bin[4];
    const rti_quad one = rti_qset(1);
    rti_quad refs = rti_qset(0), at = one;
    int axis, i;
    RTI_UNROLL
    for (axis = 0; axis < 3; axis++) s[axis] = rti_hull_of(&rti_empty_box);
    for (i = count - 1; i > 0; i--) {                                   /* right[i] = bins i.. together */
        RTI_UNROLL
        for (axis = 0; axis < 3; axis++) rti_hull_grow(&s[axis], bins->box[axis][i].lo, bins->box[axis][i].hi);
        refs = rti_qadd(refs, ranked ? one : rti_qcounts(bins->count[i]));
        right[i] = rti_qmul(rti_half_areas(s, unit), refs);
    }
    RTI_UNROLL
    for (axis = 0; axis < 3; axis++) s[axis] = rti_hull_of(&rti_empty_box);
    refs = rti_qset(0);
    for (i = 1; i < count; i++) {                                       /* s = bins ..i-1 together */
        rti_quad cost;
        RTI_UNROLL
        for (axis = 0; axis < 3; axis++) rti_hull_grow(&s[axis], bins->box[axis][i - 1].lo, bins->box[axis][i - 1].hi);
        refs = rti_qadd(refs, ranked ? one : rti_qcounts(bins->count[i - 1]));
        cost = rti_qadd(rti_qmul(rti_half_areas(s, unit), refs), right[i]);
        where = rti_qless(cost, least, at, where);
        least = rti_qmin(cost, least);
        at = rti_qadd(at, one);
    }
    rti_qstore(costs, least);
    rti_qstore(bin, where);
    best->axis = -1;
    for (axis = 0; axis < 3; axis++)
        if (may[axis] > 0 && (best->axis < 0 || costs[axis] < best->cost)) {
            best->axis = axis;
            best->cost = costs[axis];
            best->bin = (int)bin[axis];
        }
    if (best->axis < 0) return false;
    best->left_count = ranked ? (size_t)best->bin : 0;
    for (i = 0; i < best->bin && !ranked; i++) best->left_count += bins->count[i][best->axis];
    return true;
}

/* The boxes of both sides of a split. */
RTI_INLINE void rti_split_boxes(const rti_bins *bins, int count, const rti_split *split, rti_box sides[2])
{
    const rti_box *box = bins->box[split->axis];
    rti_hull left = rti_hull_of(&box[0]), right = rti_hull_of(&box[count - 1]);
    int i;
    for (i = 1; i < split->bin; i++) rti_hull_grow(&left, box[i].lo, box[i].hi);
    for (i = split->bin; i < count - 1; i++) rti_hull_grow(&right, box[i].lo, box[i].hi);
    rti_hull_put(&sides[0], &left);
    rti_hull_put(&sides[1], &right);
}

/* ---- >>bvh ---------------------------------------------------------------------------------------------------------- */

/* Top-down binned SAH. Nodes over more than RTI_TASK refs are split one after the other, their refs in slices that are binned and moved in
   parallel; the rest is one task each. A split there moves refs from one of two arrays to the other, keeping their order, so that the tree
   does not depend on threads; a task moves its refs within its own bough of the array. What a task makes stands in its own bough of the pool,
   which has room for 2 nodes a ref, and is copied behind what the tasks on its left have made. */

#define RTI_TASK  ((size_t)1 << 13)
#define RTI_SLICE ((size_t)1 << 13)
#define RTI_TRAVERSAL_COST 1.2              /* of a node, in primitive tests; measured, see tests/bench.c */

typedef struct { size_t first, count; uint32_t node; int depth; rti_box box; } rti_work;

typedef struct {
    rti_bins bins;
    rti_box sides[2];                       /* of centroids */
    size_t next[2];                         /* where this slice's lefts and rights go */
} rti_slice;

/* A node above the tasks, or a task. */
typedef struct {
    rti_node node;                          /* the root of what the task makes */
    rti_work work;
    bool inner, moved;                      /* moved: the refs are in the other array */
    uint32_t nodes, at, below;              /* how many a task makes below node; where node goes, and where these go */
    int depth;
} rti_bough;

typedef struct { rti_work work; rti_box centroids; bool moved; } rti_top;

typedef struct {
    rt_accel *accel;
    rti_node *pool;                         /* 2 a ref; until tasks run, the other array of refs */
    rti_ref *refs, *spare;
    rti_slice *slices;
    rti_bough *boughs;
    size_t bough_count;
    const rt_geometry *geo;
    const rt_build_options *opt;
    uint32_t *slot_of;                      /* of a ref, among those of its kind; NULL: all are of one, or rti_lay_limbs tells */
    bool mixed;                             /* refs are of several kinds */
    int bins;
    float traversal_cost;
    const rti_top *top;                     /* what is being split */
    const rti_binning *binning;
    const rti_split *split;
} rti_builder;

static size_t rti_slice_total(size_t count) { return (count + RTI_SLICE - 1) / RTI_SLICE; }

/* Where one begins: they are of about one size, so that threads are done at the same time. */
static size_t rti_slice_first(size_t count, size_t slice) { return (size_t)((uint64_t)count * slice / rti_slice_total(count)); }

/* SAH's answer to whether a node of so many refs is split. */
RTI_INLINE bool rti_split_pays(const rti_builder *b, const rti_box *box, size_t count, const rti_split *split)
{
    const float x = (box->hi[0] - box->lo[0]) * split->unit, y = (box->hi[1] - box->lo[1]) * split->unit;
    const float z = (box->hi[2] - box->lo[2]) * split->unit, area = rti_keepf((x + y) * z) + rti_keepf(x * y);
    return count > RTI_MAX_LEAF || rti_keepf(b->traversal_cost * area) + split->cost < (float)count * area;
}

/* Are so few levels left that only halving is sure to end in time? 2 levels are kept for rti_sort_kinds. */
RTI_INLINE bool rti_must_halve(int depth, size_t count)
{
    return depth >= RTI_MAX_DEPTH - 2 - 28 && depth + rti_ceil_log2(count) >= RTI_MAX_DEPTH - 2;
}

RTI_INLINE void rti_bounds_of(const rti_ref *refs, size_t count, rti_box *box, rti_box *centroids)
{
    rti_hull all = rti_hull_of(&rti_empty_box), c = all;
    size_t i;
    for (i = 0; i < count; i++) {
        const rti_quad centroid = rti_centroid(&refs[i]);
        rti_hull_grow(&all, refs[i].lo, refs[i].hi);
        c.lo = rti_qmin(c.lo, centroid);
        c.hi = rti_qmax(c.hi, centroid);
    }
    rti_hull_put(box, &all);
    rti_hull_put(centroids, &c);
}

RTI_INLINE rti_box rti_centroids_of(const rti_ref *refs, size_t count)
{
    rti_hull c = rti_hull_of(&rti_empty_box);
    rti_box box;
    size_t i;
    for (i = 0; i < count; i++) {
        const rti_quad centroid = rti_centroid(&refs[i]);
        c.lo = rti_qmin(c.lo, centroid);
        c.hi = rti_qmax(c.hi, centroid);
    }
    rti_hull_put(&box, &c);
    return box;
}

/* ---- nodes above tasks ---- */

static size_t rti_slice_range(const rti_builder *b, size_t slice, rti_ref **refs)
{
    const rti_work *work = &b->top->work;
    const size_t first = rti_slice_first(work->count, slice);
    *refs = (b->top->moved ? b->spare : b->refs) + work->first + first;
    return rti_slice_first(work->count, slice + 1) - first;
}

static void rti_slice_bounds(void *context, size_t i)
{
    rti_builder *b = (rti_builder *)context;
    rti_ref *refs;
    const size_t count = rti_slice_range(b, i, &refs);
    rti_bounds_of(refs, count, &b->slices[i].sides[0], &b->slices[i].sides[1]);
}

static void rti_slice_bin(void *context, size_t i)
{
    rti_builder *b = (rti_builder *)context;
    rti_ref *refs;
    const size_t count = rti_slice_range(b, i, &refs);
    rti_bins_clear(&b->slices[i].bins, b->bins);
    rti_bins_fill(&b->slices[i].bins, b->binning, refs, count);
}

static void rti_slice_move(void *context, size_t i)
{
    rti_builder *b = (rti_builder *)context;
    rti_slice *slice = &b->slices[i];
    const int axis = b->split->axis;
    const float origin = b->binning->origin[axis], scale = b->binning->scale[axis], plane = (float)b->split->bin;
    rti_ref *refs, *to = (b->top->moved ? b->refs : b->spare) + b->top->work.first;
    const size_t count = rti_slice_range(b, i, &refs);
    size_t k;
    slice->sides[0] = slice->sides[1] = rti_empty_box;
    for (k = 0; k < count; k++) {
        const int side = (refs[k].lo[axis] + refs[k].hi[axis] - origin) * scale < plane ? 0 : 1;
        const rti_quad c = rti_centroid(&refs[k]);
        rti_box *box = &slice->sides[side];
        rti_qstore(box->lo, rti_qmin(c, rti_qload(box->lo)));
        rti_qstore(box->hi, rti_qmax(c, rti_qload(box->hi)));
        to[slice->next[side]++] = refs[k];
    }
}

/* Both halves of a node above tasks. */
static void rti_split_top(rti_builder *b, const rti_top *top, rti_top halves[2])
{
    const rti_work *work = &top->work;
    const size_t slices = rti_slice_total(work->count);
    rti_binning binning = rti_make_binning(&top->centroids, b->bins);
    rti_split split;
    rti_bins all;
    size_t i, next[2];
    int k, j;
    split.axis = -1;
    split.unit = rti_unit_of(&work->box);
    b->top = top;
    b->binning = &binning;
    b->split = &split;
    if (!rti_must_halve(work->depth, work->count)) {
        rti_for(b->opt->parallel_for, b->opt->parallel_user, slices, rti_slice_bin, b);
        all = b->slices[0].bins;
        for (i = 1; i < slices; i++) rti_bins_merge(&all, &b->slices[i].bins, b->bins);
        (void)rti_best_split(&all, b->bins, binning.scale, false, &split);
    }
    halves[0] = halves[1] = *top;
    halves[0].work.count = split.axis < 0 ? work->count / 2 : split.left_count;
    halves[1].work.first += halves[0].work.count;
    halves[1].work.count -= halves[0].work.count;
    for (k = 0; k < 2; k++) {
        rti_top *half = &halves[k];
        half->work.depth++;
        if (split.axis >= 0) {
            half->moved = !top->moved;
            half->centroids = rti_empty_box;
        } else rti_bounds_of((top->moved ? b->spare : b->refs) + half->work.first, half->work.count, &half->work.box, &half->centroids);
    }
    if (split.axis < 0) return;             /* all centroids are equal, or it is too deep: halved as they stand */
    {
        rti_box sides[2];
        rti_split_boxes(&all, b->bins, &split, sides);
        halves[0].work.box = sides[0];
        halves[1].work.box = sides[1];
    }
    next[0] = 0;
    next[1] = split.left_count;
    for (i = 0; i < slices; i++) {
        rti_slice *slice = &b->slices[i];
        const size_t count = rti_slice_first(work->count, i + 1) - rti_slice_first(work->count, i);
        size_t left = 0;
        for (j = 0; j < split.bin; j++) left += slice->bins.count[j][split.axis];
        memcpy(slice->next, next, sizeof next);
        next[0] += left;
        next[1] += count - left;
    }
    rti_for(b->opt->parallel_for, b->opt->parallel_user, slices, rti_slice_move, b);
    for (i = 0; i < slices; i++)
        for (k = 0; k < 2; k++) rti_box_grow(&halves[k].centroids, b->slices[i].sides[k].lo, b->slices[i].sides[k].hi);
}

/* Splits all that is above tasks, and lists it, depth first. */
static void rti_build_tops(rti_builder *b, size_t count)
{
    rti_top stack[RTI_MAX_DEPTH + 1], halves[2];
    const size_t slices = rti_slice_total(count);
    size_t i;
    int top = 1;
    memset(stack, 0, sizeof stack[0]);
    stack[0].work.count = count;
    stack[0].work.box = stack[0].centroids = rti_empty_box;
    b->top = stack;
    rti_for(b->opt->parallel_for, b->opt->parallel_user, slices, rti_slice_bounds, b);
    for (i = 0; i < slices; i++) {
        rti_box_grow(&stack[0].work.box, b->slices[i].sides[0].lo, b->slices[i].sides[0].hi);
        rti_box_grow(&stack[0].centroids, b->slices[i].sides[1].lo, b->slices[i].sides[1].hi);
    }
    while (top) {
        const rti_top at = stack[--top];
        rti_bough *bough = &b->boughs[b->bough_count++];
        memset(bough, 0, sizeof *bough);
        bough->work = at.work;
        bough->moved = at.moved;
        bough->inner = at.work.count > RTI_TASK;
        if (!bough->inner) continue;
        rti_set_bounds(&bough->node, &at.work.box);
        rti_split_top(b, &at, halves);
        RT_ASSERT(top + 2 <= RTI_MAX_DEPTH + 1);
        stack[top++] = halves[1];
        stack[top++] = halves[0];
    }
    b->top = NULL;                          /* it pointed here */
}

/* ---- tasks ---- */

/* In place; the lefts keep their order. Without a branch, which would be guessed wrong every other time. */
RTI_INLINE size_t rti_partition(rti_ref *refs, size_t count, const rti_binning *binning, const rti_split *split)
{
    const int axis = split->axis;
    const float origin = binning->origin[axis], scale = binning->scale[axis], plane = (float)split->bin;
    size_t i, left = 0;
    for (i = 0; i < count; i++) {
        const rti_quad lo = rti_qload(refs[i].lo), hi = rti_qload(refs[i].hi);
        const bool goes = (refs[i].lo[axis] + refs[i].hi[axis] - origin) * scale < plane;
        rti_qstore(refs[i].lo, rti_qload(refs[left].lo));
        rti_qstore(refs[i].hi, rti_qload(refs[left].hi));
        rti_qstore(refs[left].lo, lo);
        rti_qstore(refs[left].hi, hi);
        left += goes;
    }
    return left;
}

/* A leaf holds one kind: refs of several kinds are put in order of kind, and split where the first kind ends. */
static size_t rti_sort_kinds(rti_ref *refs, size_t count)
{
    size_t i, k, firsts = 0;
    for (i = 1; i < count; i++) {           /* insertion sort: at most RTI_MAX_LEAF refs */
        rti_ref ref = refs[i];
        for (k = i; k && refs[k - 1].kind > ref.kind; k--) refs[k] = refs[k - 1];
        refs[k] = ref;
    }
    while (firsts < count && refs[firsts].kind == refs[0].kind) firsts++;
    return firsts;
}

/* Few bins for few refs: more would take time, and give no better trees. */
RTI_INLINE int rti_bins_for(const rti_builder *b, size_t count)
{
    const size_t bins = 5 + count / 8;
    return bins < (size_t)b->bins ? (int)bins : b->bins;
}

/* How many refs go left, with the boxes of both sides; all: a leaf. */
RTI_INLINE size_t rti_divide(const rti_builder *b, const rti_work *work, rti_bins *bins, rti_box sides[2])
{
    rti_ref *refs = b->refs + work->first;
    const size_t count = work->count;
    rti_box centroids;
    rti_split split;
    size_t left = count;
    if (count == 1) return 1;
    split.unit = rti_unit_of(&work->box);
    if (!rti_must_halve(work->depth, count)) {
        if (count <= RTI_RANKED) {
            static const float may[3] = { 1, 1, 1 };
            rti_bins_rank(bins, refs, count);
            if (rti_best_split(bins, (int)count, may, true, &split) && rti_split_pays(b, &work->box, count, &split)) {
                rti_split_boxes(bins, (int)count, &split, sides);
                memcpy(refs, bins->box[split.axis], count * sizeof *refs);     /* sorted, and all of each ref */
                return split.left_count;
            }
        } else {
            rti_binning binning;
            centroids = rti_centroids_of(refs, count);
            binning = rti_make_binning(&centroids, rti_bins_for(b, count));
            rti_bins_clear(bins, binning.bins);
            rti_bins_fill(bins, &binning, refs, count);
            if (rti_best_split(bins, binning.bins, binning.scale, false, &split) && rti_split_pays(b, &work->box, count, &split)) {
                rti_split_boxes(bins, binning.bins, &split, sides);
                return rti_partition(refs, count, &binning, &split);
            }
        }
    }
    if (count > RTI_MAX_LEAF) left = count / 2;                 /* all centroids equal, or too deep: halve as they stand */
    else if (b->mixed) left = rti_sort_kinds(refs, count);
    if (left < count) {
        rti_bounds_of(refs, left, &sides[0], &centroids);
        rti_bounds_of(refs + left, count - left, &sides[1], &centroids);
    }
    return left;
}

static void rti_build_task(void *context, size_t index)
{
    rti_builder *b = (rti_builder *)context;
    rti_bough *bough = &b->boughs[index];
    rti_node *const block = b->pool + 2 * bough->work.first;
    rti_work stack[RTI_MAX_DEPTH + 1];
    rti_box sides[2];
    rti_bins bins;
    int top = 0;
    if (bough->inner) return;
    bough->work.node = RT_NONE;
    stack[top++] = bough->work;
    while (top) {
        const rti_work work = stack[--top];
        rti_node *node = work.node == RT_NONE ? &bough->node : &block[work.node];
        const size_t left = rti_divide(b, &work, &bins, sides);
        int k;
        rti_set_bounds(node, &work.box);
        if (work.depth > bough->depth) bough->depth = work.depth;
        if (left == work.count) {
            node->index = (uint32_t)work.first;
            node->count = b->refs[work.first].kind << RTI_KIND_SHIFT | (uint32_t)work.count;
            continue;
        }
        RT_ASSERT(top + 2 <= RTI_MAX_DEPTH + 1);
        node->index = bough->nodes;
        node->count = 0;
        for (k = 1; k >= 0; k--) {
            rti_work *half = &stack[top++];
            half->first = work.first + (k ? left : 0);
            half->count = k ? work.count - left : left;
            half->node = bough->nodes + (uint32_t)k;
            half->depth = work.depth + 1;
            half->box = sides[k];
        }
        bough->nodes += 2;
    }
}

/* Refs that wait in the other array, which is about to become the pool. */
static void rti_bring_back(void *context, size_t index)
{
    rti_builder *b = (rti_builder *)context;
    const rti_bough *bough = &b->boughs[index];
    if (!bough->inner && bough->moved) memcpy(b->refs + bough->work.first, b->spare + bough->work.first, bough->work.count * sizeof(rti_ref));
}

/* ---- the tree ---- */

/* Copies a bough's nodes to where they belong. */
static void rti_place_bough(void *context, size_t index)
{
    rti_builder *b = (rti_builder *)context;
    const rti_bough *bough = &b->boughs[index];
    const rti_node *from = b->pool + 2 * bough->work.first;
    uint32_t i;
    for (i = 0; i <= bough->nodes; i++) {
        rti_node *to = &b->accel->nodes[i ? bough->below + i - 1 : bough->at];
        *to = i ? from[i - 1] : bough->node;
        if (!to->count) to->index += bough->below;
        else if (b->slot_of) to->index = b->slot_of[to->index];
    }
}

/* Tells each bough where its nodes go, in depth-first order, and measures depth. */
static void rti_place_boughs(rti_builder *b)
{
    uint32_t stack[RTI_MAX_DEPTH + 1], next = 1;
    size_t i;
    int top = 1;
    stack[0] = 0;
    for (i = 0; i < b->bough_count; i++) {
        rti_bough *bough = &b->boughs[i];
        bough->at = stack[--top];
        bough->below = next;
        if (bough->inner) {
            stack[top++] = next + 1;
            stack[top++] = next;
            next += 2;
        } else next += bough->nodes;
        if (bough->depth > b->accel->depth) b->accel->depth = bough->depth;
    }
    b->accel->node_count = next;
}

/* The slot of each ref among those of its kind; leaves of one kind stand in ref order. */
static void rti_number_slots(rti_builder *b, size_t count)
{
    uint32_t next[RTI_KINDS] = { 0, 0, 0 };
    size_t i;
    for (i = 0; i < count; i++) b->slot_of[i] = next[b->refs[i].kind]++;
}

/* ---- reinsertion ---- */

/* A better tree from a finished one: a node is taken out, with all that is below it, and put back where the surfaces of all inner nodes become
   least ([Bittner]). The search goes from its sibling to the siblings of its ancestors, and down from each as far as that can still be worth
   it ([Meister] 3); it mostly ends after some 25 nodes. Nodes are tried from the largest surface on, a batch at a time: each looks for its
   place in the tree as it was before the batch, and so in parallel; then one after the other moves where that is still worth it. So the tree
   does not depend on threads. Leaves stay what they are, but refs are in their order no more: all is laid out anew. */

#define RTI_BATCH    1024                   /* as good as 1 */
#define RTI_SEARCHES 64                     /* by one call of a parallel_for's body */
#define RTI_LOOKS    256                    /* the most nodes that a search looks at below a sibling: bounds time where many boxes overlap */
#define RTI_LIMB_LEAF 0x80000000u

/* A node that is linked: its two children, or, of a leaf, its first ref and RTI_LIMB_LEAF with what rti_node has as count. */
typedef struct { float lo[3]; uint32_t left; float hi[3]; uint32_t right; } rti_limb;
typedef char rti_check_limb[sizeof(rti_limb) == sizeof(rti_node) ? 1 : -1];

typedef struct {
    rti_limb *limbs;
    uint32_t *parents;                      /* of a node; RT_NONE of the root */
    unsigned char *heights;                 /* edges down to the deepest leaf */
    uint32_t *chosen;                       /* nodes to move, by turns; */
    const uint32_t *batch;                  /* batch_count of them, */
    size_t batch_count;
    uint32_t places[RTI_BATCH];             /* and what to move each beside; RT_NONE: it stays */
    rti_quad unit;
} rti_graft;

RTI_INLINE rti_hull rti_limb_hull(const rti_limb *limb)
{
    rti_hull s;
    s.lo = rti_qxyz(rti_qload(limb->lo));
    s.hi = rti_qxyz(rti_qload(limb->hi));
    return s;
}

RTI_INLINE rti_hull rti_hull_both(rti_hull a, rti_hull b)
{
    a.lo = rti_qmin(a.lo, b.lo);
    a.hi = rti_qmax(a.hi, b.hi);
    return a;
}

RTI_INLINE float rti_hull_area(rti_hull s, rti_quad unit)
{
    const rti_quad d = rti_qmul(rti_qsub(s.hi, s.lo), unit);
    return rti_qsum(rti_qmul(d, rti_qyzx(d)));
}

RTI_INLINE uint32_t rti_sibling(const rti_graft *g, uint32_t node)
{
    const rti_limb *parent = &g->limbs[g->parents[node]];
    return parent->left == node ? parent->right : parent->left;
}

static int rti_limb_depth(const rti_graft *g, uint32_t node)
{
    int depth = 0;
    while ((node = g->parents[node]) != RT_NONE) depth++;
    return depth;
}

/* May x stand beside a node at this depth? */
RTI_INLINE bool rti_place_fits(const rti_graft *g, uint32_t x, uint32_t node, int depth)
{
    const int height = g->heights[x] > g->heights[node] ? g->heights[x] : g->heights[node];
    return depth + 1 + height <= RTI_MAX_DEPTH;
}

/* The root stays where it is, and with it its children: taking one out would take out the root. */
RTI_INLINE bool rti_may_move(const rti_graft *g, uint32_t node)
{
    return g->parents[node] != RT_NONE && g->parents[g->parents[node]] != RT_NONE;
}

/* Beside what x, which may move, saves most surface; RT_NONE: where it is. */
static uint32_t rti_find_place(const rti_graft *g, uint32_t x)
{
    struct { uint32_t node; int depth; float spent, joint; } stack[RTI_MAX_DEPTH + 1];
    const rti_limb *limbs = g->limbs;
    const rti_quad unit = g->unit;
    const rti_hull box = rti_limb_hull(&limbs[x]);
    const float area = rti_hull_area(box, unit);
    uint32_t best = RT_NONE, at = x, above = g->parents[x];
    float won = 0, saved = rti_hull_area(rti_limb_hull(&limbs[above]), unit);      /* saved: surface that is gone when x is out */
    int depth = rti_limb_depth(g, above), looks = 0;
    rti_hull rest = box;                                                           /* what is below above without x */
    while (above != RT_NONE) {
        uint32_t node = rti_sibling(g, at);
        const rti_hull beside = rti_limb_hull(&limbs[node]);
        float spent = 0, joint = rti_hull_area(rti_hull_both(box, beside), unit);  /* spent: by how much x makes larger what is above node; */
        int below = depth + 1, top = 0;                                            /* joint: node and x together */
        for (;;) {
            const rti_limb *limb = &limbs[node];
            if (saved - spent - joint > won && rti_place_fits(g, x, node, below)) {
                won = saved - spent - joint;
                best = node;
            }
            spent += joint - rti_hull_area(rti_limb_hull(limb), unit);
            if (!(limb->right & RTI_LIMB_LEAF) && saved - spent - area > won && looks++ < RTI_LOOKS) {
                const float left = rti_hull_area(rti_hull_both(box, rti_limb_hull(&limbs[limb->left])), unit);
                const float right = rti_hull_area(rti_hull_both(box, rti_limb_hull(&limbs[limb->right])), unit);
                const bool swap = right < left;
                RT_ASSERT(top <= RTI_MAX_DEPTH);
                stack[top].node = swap ? limb->left : limb->right;
                stack[top].depth = ++below;
                stack[top].spent = spent;
                stack[top++].joint = swap ? left : right;
                node = swap ? limb->right : limb->left;
                joint = swap ? right : left;
                continue;
            }
            while (top && !(saved - stack[top - 1].spent - area > won)) top--;
            if (!top--) break;
            node = stack[top].node;
            below = stack[top].depth;
            spent = stack[top].spent;
            joint = stack[top].joint;
        }
        if (at == x) rest = beside;
        else {
            rest = rti_hull_both(rest, beside);
            saved -= rti_hull_area(rest, unit);
            if (saved > won && g->parents[above] != RT_NONE && rti_place_fits(g, x, above, depth)) {
                won = saved;
                best = above;
            }
            saved += rti_hull_area(rti_limb_hull(&limbs[above]), unit);
        }
        at = above;
        above = g->parents[above];
        depth--;
    }
    return best;
}

static void rti_find_places(void *context, size_t part)
{
    rti_graft *g = (rti_graft *)context;
    size_t i = part * RTI_SEARCHES, end = g->batch_count - i < RTI_SEARCHES ? g->batch_count : i + RTI_SEARCHES;
    for (; i < end; i++) g->places[i] = rti_may_move(g, g->batch[i]) ? rti_find_place(g, g->batch[i]) : RT_NONE;
}

/* Sets box and height of a node from its children's; answers by how much its surface grows. same: nothing changes. */
RTI_INLINE float rti_limb_refit(rti_graft *g, uint32_t node, bool *same)
{
    rti_limb *limb = &g->limbs[node];
    const unsigned char left = g->heights[limb->left], right = g->heights[limb->right], height = (unsigned char)(1 + (left > right ? left : right));
    const rti_hull was = rti_limb_hull(limb), is = rti_hull_both(rti_limb_hull(&g->limbs[limb->left]), rti_limb_hull(&g->limbs[limb->right]));
    float lo[4], hi[4];
    *same = rti_qsame(was.lo, is.lo) && rti_qsame(was.hi, is.hi) && height == g->heights[node];
    g->heights[node] = height;
    rti_qstore(lo, is.lo);
    rti_qstore(hi, is.hi);
    memcpy(limb->lo, lo, sizeof limb->lo);
    memcpy(limb->hi, hi, sizeof limb->hi);
    return rti_hull_area(is, g->unit) - rti_hull_area(was, g->unit);
}

/* Puts is where was is among the children of above, and refits from there up; answers by how much surfaces grow. */
static double rti_replace(rti_graft *g, uint32_t above, uint32_t was, uint32_t is)
{
    double grown = 0;
    bool same = false;
    if (g->limbs[above].left == was) g->limbs[above].left = is;
    else g->limbs[above].right = is;
    g->parents[is] = above;
    for (; above != RT_NONE && !same; above = g->parents[above]) grown += (double)rti_limb_refit(g, above, &same);
    return grown;
}

/* Moves x beside node, its parent with it; answers by how much surfaces grow. */
static double rti_move_limb(rti_graft *g, uint32_t x, uint32_t node)
{
    const uint32_t parent = g->parents[x];
    double grown = rti_replace(g, g->parents[parent], parent, rti_sibling(g, x));
    const uint32_t above = g->parents[node];
    bool same;
    g->limbs[parent].left = node;
    g->limbs[parent].right = x;
    g->parents[node] = parent;
    grown += (double)rti_limb_refit(g, parent, &same);
    return grown + rti_replace(g, above, node, parent);
}

/* Where moves before this one have left it possible, and worth it. */
static void rti_try_move(rti_graft *g, uint32_t x, uint32_t node)
{
    uint32_t at, sibling;
    int depth = -1;
    if (!rti_may_move(g, x) || g->parents[node] == RT_NONE || node == g->parents[x] || node == (sibling = rti_sibling(g, x))) return;
    for (at = node; at != RT_NONE && at != x; at = g->parents[at]) depth++;
    if (at == x || !rti_place_fits(g, x, node, depth)) return;
    if (!(rti_move_limb(g, x, node) < 0)) (void)rti_move_limb(g, x, sibling);
}

/* Upper bits of the surface, which order as it does: its exponent and 3 bits more. */
#define RTI_AREA_KEYS 2048
RTI_INLINE uint32_t rti_area_key(const rti_graft *g, size_t node)
{
    const float area = rti_hull_area(rti_limb_hull(&g->limbs[node]), g->unit);
    uint32_t bits;
    memcpy(&bits, &area, sizeof bits);
    return bits >> 20;
}

/* Lists the count nodes of largest surface, as their keys tell it, but for the root. */
static void rti_choose_limbs(rti_graft *g, size_t nodes, size_t count)
{
    uint32_t starts[RTI_AREA_KEYS], next = 0, key;
    size_t i;
    memset(starts, 0, sizeof starts);
    for (i = 1; i < nodes; i++) starts[rti_area_key(g, i)]++;
    for (key = RTI_AREA_KEYS; key-- > 0;) {
        const uint32_t some = starts[key];
        starts[key] = next;
        next += some;
    }
    for (i = 1; i < nodes; i++) {
        uint32_t *start = &starts[rti_area_key(g, i)];
        if (*start < count) g->chosen[(*start)++] = (uint32_t)i;
    }
}

/* Of a 64th of the nodes, twice; for RT_BUILD_HIGH then of as many again, and so on up to all. */
static void rti_reinsert(rti_graft *g, const rt_build_options *opt, size_t nodes)
{
    int part, last = opt->quality == RT_BUILD_HIGH ? 0 : 6;
    for (part = 7; part >= last; part--) {
        const size_t most = (nodes >> (part < 6 ? part : 6)) + 32, count = most < nodes - 1 ? most : nodes - 1;
        size_t first, i;
        if (part != 6) rti_choose_limbs(g, nodes, count);
        for (first = 0; first < count; first += RTI_BATCH) {
            g->batch = g->chosen + first;
            g->batch_count = count - first < RTI_BATCH ? count - first : RTI_BATCH;
            rti_for(opt->parallel_for, opt->parallel_user, (g->batch_count + RTI_SEARCHES - 1) / RTI_SEARCHES, rti_find_places, g);
            for (i = 0; i < g->batch_count; i++)
                if (g->places[i] != RT_NONE) rti_try_move(g, g->batch[i], g->places[i]);
        }
    }
}

/* Lays limbs out as nodes, children side by side and in depth-first order. Kinds of refs, which leaves tell, make room for prims in order of
   leaves. */
static void rti_lay_limbs(rti_builder *b, const rti_graft *g)
{
    struct { uint32_t from, to; } stack[RTI_MAX_DEPTH + 1];
    uint32_t next = 1, slots[RTI_KINDS] = { 0, 0, 0 }, i;
    size_t out = 0;
    int top = 1;
    stack[0].from = stack[0].to = 0;
    while (top) {
        const rti_limb *limb = &g->limbs[stack[--top].from];
        rti_node *node = &b->accel->nodes[stack[top].to];
        memcpy(node->bounds, limb->lo, 3 * sizeof(float));
        memcpy(node->bounds + 3, limb->hi, 3 * sizeof(float));
        node->count = 0;
        node->index = next;
        if (limb->right & RTI_LIMB_LEAF) {
            node->count = limb->right & ~RTI_LIMB_LEAF;
            node->index = slots[rti_leaf_kind(node)];
            slots[rti_leaf_kind(node)] += rti_leaf_count(node);
            for (i = 0; i < rti_leaf_count(node); i++) b->refs[out++].kind = b->refs[limb->left + i].prim;
            continue;
        }
        RT_ASSERT(top + 2 <= RTI_MAX_DEPTH + 1);
        stack[top].from = limb->right;
        stack[top++].to = next + 1;
        stack[top].from = limb->left;
        stack[top++].to = next;
        next += 2;
    }
    b->accel->depth = g->heights[0];
}

/* Of a tree whose leaves have their first ref as index; works in the pool. */
static rt_status rti_improve(rti_builder *b)
{
    const rti_node *nodes = b->accel->nodes;
    const size_t count = b->accel->node_count;
    void *user = b->opt->memory_user;
    rti_graft g;
    rti_box box;
    size_t i;
    int k;
    g.parents = (uint32_t *)rti_alloc(count, 2 * sizeof(uint32_t) + 1, user);
    if (!g.parents) return RT_ERROR_MEMORY;
    g.limbs = (rti_limb *)(void *)b->pool;
    g.chosen = g.parents + count;
    g.heights = (unsigned char *)(g.chosen + count);
    g.parents[0] = RT_NONE;
    for (i = count; i-- > 0;) {             /* children first */
        rti_limb *limb = &g.limbs[i];
        memcpy(limb->lo, nodes[i].bounds, sizeof limb->lo);
        memcpy(limb->hi, nodes[i].bounds + 3, sizeof limb->hi);
        limb->left = nodes[i].index;
        limb->right = nodes[i].count ? nodes[i].count | RTI_LIMB_LEAF : nodes[i].index + 1;
        g.heights[i] = 0;
        for (k = 0; k < 2 && !nodes[i].count; k++) {
            const uint32_t child = nodes[i].index + (uint32_t)k;
            g.parents[child] = (uint32_t)i;
            if (g.heights[child] >= g.heights[i]) g.heights[i] = (unsigned char)(g.heights[child] + 1);
        }
    }
    memcpy(box.lo, nodes[0].bounds, 3 * sizeof(float));
    memcpy(box.hi, nodes[0].bounds + 3, 3 * sizeof(float));
    g.unit = rti_qset(rti_unit_of(&box));
    rti_reinsert(&g, b->opt, count);
    rti_lay_limbs(b, &g);
    rti_release(g.parents, user);
    return RT_OK;
}

static rt_status rti_build_bvh(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt, rti_ref *refs, size_t count)
{
    void *user = opt->memory_user;
    const bool mixed = rti_sphere_count(geo) || rti_instance_count(geo), improve = opt->quality != RT_BUILD_FAST;
    rti_builder b;
    rt_status status = RT_ERROR_MEMORY;

    memset(&b, 0, sizeof b);
    b.accel = accel;
    b.geo = geo;
    b.opt = opt;
    b.refs = refs;
    b.bins = opt->quality == RT_BUILD_FAST ? 8 : opt->quality == RT_BUILD_HIGH ? 32 : 16;
    b.traversal_cost = opt->traversal_cost > 0 ? opt->traversal_cost : (float)RTI_TRAVERSAL_COST;
    b.pool = (rti_node *)rti_alloc(count, 2 * sizeof(rti_node), user);
    b.spare = (rti_ref *)(void *)b.pool;
    b.slices = (rti_slice *)rti_alloc(rti_slice_total(count), sizeof(rti_slice), user);
    b.boughs = (rti_bough *)rti_alloc(2 * RTI_MAX_DEPTH * (count / RTI_TASK) + 1, sizeof(rti_bough), user);    /* a level has count / RTI_TASK above */
    b.mixed = mixed;
    if (mixed && !improve) b.slot_of = (uint32_t *)rti_alloc(count, sizeof(uint32_t), user);
    if (!b.pool || !b.slices || !b.boughs || (mixed && !improve && !b.slot_of)) goto out;
    rti_build_tops(&b, count);
    rti_for(opt->parallel_for, opt->parallel_user, b.bough_count, rti_bring_back, &b);
    rti_for(opt->parallel_for, opt->parallel_user, b.bough_count, rti_build_task, &b);

    rti_place_boughs(&b);
    accel->nodes = (rti_node *)rti_alloc(accel->node_count, sizeof(rti_node), user);
    if (!accel->nodes) goto out;
    accel->bytes += accel->node_count * sizeof(rti_node);
    if (b.slot_of) rti_number_slots(&b, count);
    rti_for(opt->parallel_for, opt->parallel_user, b.bough_count, rti_place_bough, &b);
    rti_set_root(accel);
    if (improve && rti_improve(&b) != RT_OK) goto out;
    rti_release(b.pool, user);
    b.pool = NULL;
    if (rti_fill_slots(accel, geo, opt, improve ? &refs->kind : &refs->prim, sizeof *refs / sizeof refs->prim, count)) status = RT_OK;
out:
    rti_release(b.pool, user);
    rti_release(b.slices, user);
    rti_release(b.boughs, user);
    rti_release(b.slot_of, user);
    return status;
}

#endif /* RTI_BVH || RTI_THREADED */

/* ---- >>collapse ----------------------------------------------------------------------------------------------------- */

#if RTI_BVH

/* From the binary tree to nodes with up to RTI_CHILDREN children, see RT_BVH_WIDE ([Dammertz]). Which binary nodes stay, each with children from
   several levels below, is so chosen that their surfaces together, and so how many of them rays visit, are least ([Ylitie] 3.1): bottom up, the
   least is found for each number of places that a binary node may take among its parent's children. */

/* What is known of a binary node: RTI_ATOM, if it stays whole, as a leaf, and then how many triangles are below it if they are to fill an octet
   together; else the number of its rti_fan. */
#define RTI_ATOM 0x80000000u

/* Of a node that is no atom: the least surface, over the root's, of the wide nodes made of it and of all below, by how many places it takes at
   most: [0] one, as a wide node itself, to all but one. */
typedef struct { float least[RTI_CHILDREN - 1]; } rti_fan;

/* A wide node to be: which binary nodes its children are (RTI_END: none), and the numbers of the first of them that is a wide node, which
   is above its own, and of the first octet. */
typedef struct { uint32_t children[RTI_CHILDREN], wide, octet; } rti_wide_plan;

typedef struct {
    const rt_accel *accel;
    uint32_t *marks;                        /* of each binary node */
    rti_fan *fans;
    rti_wide_plan *plans;
    size_t wide_count, octet_count;
    uint32_t depth;                         /* of the deepest wide node */
} rti_collapse;

/* octets: leaves are of as many triangles as an octet holds, since it is tested at once however full it is; else those of the binary tree.
   Answers how many nodes are no atoms. */
static uint32_t rti_mark_atoms(rti_collapse *c, bool octets)
{
    uint32_t fans = 0;
    size_t i;
    for (i = c->accel->node_count; i-- > 0;) {          /* children stand behind their parents */
        const rti_node *node = &c->accel->nodes[i];
        if (node->count) c->marks[i] = RTI_ATOM | (octets && rti_leaf_kind(node) == RTI_TRIANGLE ? rti_leaf_count(node) : 0);
        else {
            const uint32_t a = c->marks[node->index], b = c->marks[node->index + 1], both = (a & ~RTI_ATOM) + (b & ~RTI_ATOM);
            const bool atom = a > RTI_ATOM && b > RTI_ATOM && both <= RTI_CHILDREN;
            c->marks[i] = atom ? RTI_ATOM | both : fans++;
        }
    }
    return fans;
}

RTI_INLINE const float *rti_fan_of(const rti_collapse *c, uint32_t node)
{
    static const float atom[RTI_CHILDREN - 1] = { 0 };
    return c->marks[node] & RTI_ATOM ? atom : c->fans[c->marks[node]].least;
}

/* The least when two children share so many places. */
RTI_INLINE float rti_share_places(const float *left, const float *right, int places)
{
    float least = left[0] + right[places - 2];
    int k;
    RTI_UNROLL
    for (k = 2; k < places; k++) {
        const float sum = left[k - 1] + right[places - k - 1];
        least = sum < least ? sum : least;
    }
    return least;
}

static void rti_spread_fans(rti_collapse *c)
{
    const double all = rti_node_area(&c->accel->nodes[0]), unit = all > 0 ? 1 / all : 0;
    size_t i;
    int k;
    for (i = c->accel->node_count; i-- > 0;) {
        const rti_node *node = &c->accel->nodes[i];
        const float *left, *right;
        float *least;
        if (c->marks[i] & RTI_ATOM) continue;
        least = c->fans[c->marks[i]].least;
        left = rti_fan_of(c, node->index);
        right = rti_fan_of(c, node->index + 1);
        least[0] = rti_share_places(left, right, RTI_CHILDREN) + (float)(rti_node_area(node) * unit);
        RTI_UNROLL
        for (k = 1; k < RTI_CHILDREN - 1; k++) {
            const float shared = rti_share_places(left, right, k + 1);
            least[k] = shared < least[k - 1] ? shared : least[k - 1];
        }
    }
}

/* Lists the children of the wide node that root becomes, from left to right. */
static int rti_open_children(const rti_collapse *c, uint32_t root, uint32_t children[RTI_CHILDREN])
{
    struct { uint32_t node; int places; } stack[RTI_CHILDREN];
    int n = 0, top = 1;
    stack[0].node = root;
    stack[0].places = RTI_CHILDREN;
    while (top) {
        const uint32_t node = stack[--top].node, below = c->accel->nodes[node].index;
        const float *least = rti_fan_of(c, node), *left, *right;
        int places = stack[top].places, k = 1;
        float shared;
        if (c->marks[node] & RTI_ATOM) places = 1;
        while (places > 1 && places < RTI_CHILDREN && least[places - 1] == least[places - 2]) places--;      /* as good without one */
        if (places == 1) {
            children[n++] = node;
            continue;
        }
        left = rti_fan_of(c, below);
        right = rti_fan_of(c, below + 1);
        shared = rti_share_places(left, right, places);
        while (k < places - 1 && left[k - 1] + right[places - k - 1] > shared) k++;
        stack[top].node = below + 1;
        stack[top++].places = places - k;
        stack[top].node = below;
        stack[top++].places = k;
    }
    return n;
}

/* Plans wide nodes, depth first, and counts them and octets. */
static void rti_plan_wides(rti_collapse *c)
{
    struct { uint32_t node, wide, depth; } stack[RTI_WIDE_STACK];
    int top = 1;
    memset(stack, 0, sizeof stack[0]);
    c->wide_count = 1;
    while (top) {
        const uint32_t depth = stack[--top].depth;
        rti_wide_plan *plan = &c->plans[stack[top].wide];
        const int n = rti_open_children(c, stack[top].node, plan->children);
        int i, inner = 0;
        if (depth > c->depth) c->depth = depth;
        plan->wide = (uint32_t)c->wide_count;
        plan->octet = (uint32_t)c->octet_count;
        for (i = 0; i < n; i++) {
            const uint32_t mark = c->marks[plan->children[i]];
            if (mark > RTI_ATOM) c->octet_count++;
            else if (mark < RTI_ATOM) inner++;
        }
        c->wide_count += (size_t)inner;
        for (i = n; i-- > 0;)               /* the first is next */
            if (c->marks[plan->children[i]] < RTI_ATOM) {
                stack[top].node = plan->children[i];
                stack[top].depth = depth + 1;
                stack[top++].wide = plan->wide + (uint32_t)--inner;
            }
        for (i = n; i < RTI_CHILDREN; i++) plan->children[i] = RTI_END;
    }
}

/* False: out of memory. To be released in any case. */
RTI_INLINE bool rti_begin_collapse(rti_collapse *c, const rt_accel *accel, bool octets, void *user)
{
    uint32_t fans;
    memset(c, 0, sizeof *c);
    c->accel = accel;
    c->marks = (uint32_t *)rti_alloc(accel->node_count, sizeof *c->marks, user);
    if (!c->marks) return false;
    fans = rti_mark_atoms(c, octets);
    c->fans = (rti_fan *)rti_alloc(fans + 1, sizeof *c->fans, user);
    c->plans = (rti_wide_plan *)rti_alloc(fans + 1, sizeof *c->plans, user);       /* the root is one even if it is an atom */
    if (!c->fans || !c->plans) return false;
    rti_spread_fans(c);
    rti_plan_wides(c);
    return true;
}

RTI_INLINE void rti_end_collapse(rti_collapse *c, void *user)
{
    rti_release(c->marks, user);
    rti_release(c->fans, user);
    rti_release(c->plans, user);
}

#if RTI_WIDES
typedef struct { rt_accel *accel; const rti_collapse *collapse; } rti_wide_job;

static void rti_fill_octet(rti_octet *octet, const rti_triangle *triangles, uint32_t count)
{
    uint32_t i;
    int k;
    for (i = 0; i < RTI_CHILDREN; i++) {
        const rti_triangle *t = &triangles[i < count ? i : 0];
        octet->prim[i] = t->prim;
        for (k = 0; k < 9; k++) octet->v[k][i] = t->v[k];
    }
}

static void rti_fill_wide(const rti_wide_job *job, const rti_wide_plan *plan, rti_wide *wide)
{
    const rt_accel *accel = job->accel;
    uint32_t inner = plan->wide, octet = plan->octet;
    int i, k;
    for (i = 0; i < RTI_CHILDREN; i++) {
        const uint32_t child = plan->children[i], mark = child != RTI_END ? job->collapse->marks[child] : 0;
        const rti_node *node = child != RTI_END ? &accel->nodes[child] : NULL;
        for (k = 0; k < 6; k++) wide->bounds[k][i] = node ? node->bounds[k] : k < 3 ? RTI_INFINITY : -RTI_INFINITY;
        wide->index[i] = 0;
        wide->count[i] = node ? 0 : RTI_NO_CHILD;
        if (!node) continue;
        if (mark > RTI_ATOM) {
            const uint32_t count = mark & ~RTI_ATOM;
            while (!node->count) node = &accel->nodes[node->index];             /* the first slot */
            wide->count[i] = RTI_TRIANGLE << RTI_KIND_SHIFT | count;
            wide->index[i] = accel->octets ? octet : node->index;
            if (accel->octets) rti_fill_octet(&accel->octets[octet++], accel->triangles + node->index, count);
        } else if (node->count) {
            wide->count[i] = node->count;
            wide->index[i] = node->index;
        } else wide->index[i] = inner++;
    }
}

static void rti_fill_wides(void *context, size_t chunk)
{
    const rti_wide_job *job = (const rti_wide_job *)context;
    const size_t size = RTI_CHUNK / 32, first = chunk * size, left = job->accel->wide_count - first;
    size_t i;
    for (i = first; i < first + (left < size ? left : size); i++) rti_fill_wide(job, &job->collapse->plans[i], &job->accel->wides[i]);
}

/* opt->no_binary: what only other algorithms read. */
static void rti_drop_binary(rt_accel *accel, const rti_collapse *c)
{
    accel->bytes -= accel->node_count * sizeof(rti_node);
    rti_release(accel->nodes, accel->memory_user);
    accel->nodes = NULL;
    accel->node_count = c->wide_count;
    accel->depth = (int)c->depth + 1;
    if (accel->octets && accel->triangles) {
        accel->bytes -= accel->slots[RTI_TRIANGLE] * sizeof(rti_triangle);
        rti_release(accel->triangles, accel->memory_user);
        accel->triangles = NULL;
    }
}

static rt_status rti_build_wide(rt_accel *accel, const rt_build_options *opt)
{
    const size_t line = 64, size = RTI_CHUNK / 32;  /* a line of the cache: nodes and octets start at one; wide nodes filled together */
    rti_collapse c;
    rti_wide_job job;
    job.accel = accel;
    job.collapse = &c;
    if (rti_begin_collapse(&c, accel, true, accel->memory_user) && c.wide_count + c.octet_count <= (SIZE_MAX - line) / sizeof(rti_octet)) {
        const size_t bytes = c.wide_count * sizeof(rti_wide) + (opt->reference ? 0 : c.octet_count * sizeof(rti_octet)) + line;
        char *at = (char *)(accel->wide_memory = rti_alloc(1, bytes, accel->memory_user));
        if (at) {
            at += (line - (uintptr_t)at % line) % line;
            accel->wide_count = c.wide_count;
            accel->octet_count = c.octet_count;
            accel->wides = (rti_wide *)(void *)at;
            if (!opt->reference) accel->octets = (rti_octet *)(void *)(at + c.wide_count * sizeof(rti_wide));
            accel->bytes += bytes;
            rti_for(opt->parallel_for, opt->parallel_user, (c.wide_count + size - 1) / size, rti_fill_wides, &job);
            if (opt->no_binary) rti_drop_binary(accel, &c);
        }
    }
    rti_end_collapse(&c, accel->memory_user);
    return accel->wides ? RT_OK : RT_ERROR_MEMORY;
}
#endif

#endif /* RTI_BVH */

/* ---- >>kdtree ------------------------------------------------------------------------------------------------------- */

/* Top-down SAH after [Havran]: the cost of a plane is traversal + area(left) * count(left) + area(right) * count(right), areas relative
   to the cell's, less a bonus where one side is empty; a node whose best plane costs more than its primitives is a leaf. A primitive on
   both sides is clipped to either cell (their "perfect splits"). Small nodes try every plane where a primitive begins or ends. Larger
   ones count beginnings and ends in bins, then once more in finer bins around the best plane, and take the nearest exact beginning or
   end: no lists to sort and to keep sorted, O(n) a level, O(n log n) in all. Primitives in a wall of the cell may be cut off into a flat
   cell, which only rays that reach the wall see.

   Nodes over RTI_KD_TASK refs are split one after the other, their refs in parallel chunks; the rest is one task each. What a node may use
   of the limit on references, its budget, is shared out at each split, so it depends neither on order nor on threads. An empty leaf
   uses one: that bounds the nodes too. */

#if RTI_KDTREE

#define RTI_KD_TASK  ((size_t)1 << 12)
#define RTI_KD_LANES 16                     /* tasks that run side by side: each has 130 KiB + 52 bytes a reference that it may make */
#define RTI_KD_BINS  32
#define RTI_KD_FEW   64                     /* the most refs for which every plane is tried, at any quality */

typedef struct {
    rti_ref *refs;
    size_t count, budget;
    uint32_t node;                          /* where it goes */
    int depth;
    rti_box cell;
} rti_kdwork;

typedef struct { int axis; float at, cost; bool planar_left; } rti_kdplane;    /* planar_left: where primitives in the plane go */

/* Cost of a split at distance x from the cell's lower plane: area(left) = x * slope + base, of a cell of area 1. */
typedef struct { float slope[3], base[3], size[3]; float traversal, bonus, budget; } rti_kdcost;

typedef struct { float origin[4], scale[4], end[4]; } rti_kdgrid;   /* bin = (x - origin) * scale; scale 0: cannot be split */
typedef struct { uint32_t starts[3][RTI_KD_BINS], ends[3][RTI_KD_BINS], walls[2][3]; } rti_kdbins;    /* walls: what lies in them */
/* A finer bin: the first and the last place where a primitive starts or ends, and how many, flat ones apart, end at the first and start
   at the last. */
typedef struct { uint32_t starts, ends, first_ends, last_starts; float first, last; } rti_kdfine;
typedef struct { rti_kdbins bins; rti_kdfine fine[RTI_KD_BINS]; size_t left, right; } rti_kdchunk;

/* A finished subtree: nodes from index 2 on are pairs, node 0 is its root; children and slots are counted from its own start. */
typedef struct { rti_kdnode *nodes; uint32_t *prims; size_t node_count, prim_count; uint32_t node; } rti_kdblock;

typedef struct { rti_kdwork work; rti_ref *refs, *spare; rti_kdblock out; } rti_kdlane;

typedef struct {
    const rt_geometry *geo;
    const rt_build_options *opt;
    float traversal, bonus;
    size_t few;                             /* up to so many refs every plane is tried */
    int max_depth;
    bool mixed;                             /* the geometry has several kinds */
    rti_kdnode *top;                        /* nodes over RTI_KD_TASK refs, and the roots of blocks */
    size_t top_count, top_limit;
    rti_kdblock *blocks;
    size_t block_count, block_limit;
    rti_kdlane *lanes;
    size_t lane_count;
    rti_ref *spare;                         /* chunks of a node being split: lefts, then rights */
    rti_kdchunk *chunks;
    const rti_kdwork *work;                 /* the node whose chunks are being worked on */
    const rti_kdgrid *grid;
    const rti_kdplane *plane;
    int axis, bin;
} rti_kdbuilder;

/* ---- the best plane */

/* False: the cell is a point. Flat cells count as a little thick, since areas say nothing about them. */
static bool rti_kd_cost(const rti_kdbuilder *b, const rti_box *cell, rti_kdcost *cost)
{
    double d[3], most = 0, area;
    int k;
    for (k = 0; k < 3; k++) {
        d[k] = (double)cell->hi[k] - (double)cell->lo[k];
        cost->size[k] = (float)d[k];
        if (d[k] > most) most = d[k];
    }
    if (!(most > 0)) return false;
    for (k = 0; k < 3; k++)
        if (d[k] < most * 1e-5) d[k] = most * 1e-5;
    area = d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    for (k = 0; k < 3; k++) {
        double a = d[(k + 1) % 3], c = d[(k + 2) % 3];
        cost->slope[k] = (float)((a + c) / area);
        cost->base[k] = (float)(a * c / area);
    }
    cost->traversal = b->traversal;
    cost->bonus = b->bonus;
    return true;
}

RTI_INLINE float rti_kd_price(const rti_kdcost *c, int axis, float x, float left, float right)
{
    float price = left * (x * c->slope[axis] + c->base[axis]) + right * ((c->size[axis] - x) * c->slope[axis] + c->base[axis]);
    return c->traversal + (left > 0 && right > 0 ? price : price * c->bonus);
}

RTI_INLINE void rti_kd_offer(rti_kdplane *best, const rti_kdcost *cost, const rti_box *cell, int axis, float at, float left,
                             float right, bool planar_left)
{
    float price;
    if (!(at > cell->lo[axis] && at < cell->hi[axis])) return;      /* a plane in the cell's wall: see rti_kd_offer_wall */
    if (left + right + (left > 0 && right > 0 ? 0.0f : 1.0f) > cost->budget) return;
    price = rti_kd_price(cost, axis, at - cell->lo[axis], left, right);
    if (price < best->cost) {
        best->cost = price;
        best->axis = axis;
        best->at = at;
        best->planar_left = planar_left;
    }
}

/* A plane in the cell's lower (0) or upper (1) wall cuts off a flat cell with what lies in that wall. */
RTI_INLINE void rti_kd_offer_wall(rti_kdplane *best, const rti_kdcost *cost, const rti_box *cell, int axis, int wall, float in_wall,
                                  float others)
{
    float price;
    if (!(in_wall > 0 && others > 0 && cost->size[axis] > 0)) return;
    price = rti_kd_price(cost, axis, wall ? cost->size[axis] : 0, wall ? others : in_wall, wall ? in_wall : others);
    if (price < best->cost) {
        best->cost = price;
        best->axis = axis;
        best->at = wall ? cell->hi[axis] : cell->lo[axis];
        best->planar_left = !wall;
    }
}

/* Of n primitives from lo to hi, for each of four planes: how many lie partly below and partly above it; and which planes are cheaper
   than limit, as bits. */
RTI_INLINE unsigned rti_kd_sides(const rti_kdcost *c, int axis, float origin, const float *lo, const float *hi, size_t n,
                                 const float at[4], float limit, float left[4], float right[4])
{
    size_t i;
#if RTI_X86
    const __m128 plane = _mm_loadu_ps(at), x = _mm_sub_ps(plane, _mm_set1_ps(origin)), slope = _mm_set1_ps(c->slope[axis]);
    const __m128 base = _mm_set1_ps(c->base[axis]), from = _mm_add_ps(_mm_mul_ps(x, slope), base);
    const __m128 to = _mm_add_ps(_mm_mul_ps(_mm_sub_ps(_mm_set1_ps(c->size[axis]), x), slope), base);
    __m128i below = _mm_setzero_si128(), above = below;
    __m128 b, a, price, empty;
    for (i = 0; i < n; i++) {
        below = _mm_sub_epi32(below, _mm_castps_si128(_mm_cmplt_ps(_mm_set1_ps(lo[i]), plane)));
        above = _mm_sub_epi32(above, _mm_castps_si128(_mm_cmplt_ps(plane, _mm_set1_ps(hi[i]))));
    }
    b = _mm_cvtepi32_ps(below);
    a = _mm_cvtepi32_ps(above);
    _mm_storeu_ps(left, b);
    _mm_storeu_ps(right, a);
    price = _mm_add_ps(_mm_mul_ps(b, from), _mm_mul_ps(a, to));
    empty = _mm_cmple_ps(_mm_min_ps(a, b), _mm_setzero_ps());
    price = _mm_or_ps(_mm_and_ps(empty, _mm_mul_ps(price, _mm_set1_ps(c->bonus))), _mm_andnot_ps(empty, price));
    return (unsigned)_mm_movemask_ps(_mm_cmplt_ps(_mm_add_ps(price, _mm_set1_ps(c->traversal)), _mm_set1_ps(limit)));
#else
    unsigned cheaper = 0;
    int j;
    for (j = 0; j < 4; j++) {
        int below = 0, above = 0;
        for (i = 0; i < n; i++) {
            below += lo[i] < at[j];
            above += hi[i] > at[j];
        }
        left[j] = (float)below;
        right[j] = (float)above;
        if (rti_kd_price(c, axis, at[j] - origin, left[j], right[j]) < limit) cheaper |= 1u << j;
    }
    return cheaper;
#endif
}

/* Every plane where one of a few refs begins or ends. */
static void rti_kd_try_all(const rti_kdwork *w, const rti_kdcost *cost, rti_kdplane *best)
{
    const size_t n = w->count;
    float lo[RTI_KD_FEW], hi[RTI_KD_FEW], planes[2 * RTI_KD_FEW + 4], flat[RTI_KD_FEW], left[4], right[4];
    size_t i, j, k, m, flats, in_wall[2];
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const float low = w->cell.lo[axis], high = w->cell.hi[axis];
        if (!(high > low)) continue;
        m = flats = in_wall[0] = in_wall[1] = 0;
        for (i = 0; i < n; i++) {
            const float a = w->refs[i].lo[axis], c = w->refs[i].hi[axis];
            lo[i] = a;
            hi[i] = c;
            in_wall[0] += c <= low;
            in_wall[1] += a >= high;
            planes[m] = a;                  /* no branches: they would be hard to predict */
            m += (size_t)((a > low) & (a < high));
            planes[m] = c;
            m += (size_t)((c > low) & (c < high) & (c > a));
            flat[flats] = a;
            flats += a >= c;
        }
        for (i = 0; i < 2; i++)
            rti_kd_offer_wall(best, cost, &w->cell, axis, (int)i, (float)in_wall[i], (float)(n - in_wall[i]));
        for (j = 0; j < m; j += 4) {
            unsigned cheaper;
            for (i = m; i < j + 4; i++) planes[i] = planes[m - 1];
            cheaper = rti_kd_sides(cost, axis, low, lo, hi, n, planes + j, best->cost, left, right);
            for (i = 0; i < 4; i++) {
                float in_plane = 0;         /* may go to either side, and rti_kd_sides saw them on neither */
                if (!(cheaper >> i & 1)) continue;
                for (k = 0; k < flats; k++) in_plane += flat[k] >= planes[j + i] && flat[k] <= planes[j + i] ? 1.0f : 0.0f;
                rti_kd_offer(best, cost, &w->cell, axis, planes[j + i], left[i] + in_plane, right[i], true);
                if (in_plane > 0) rti_kd_offer(best, cost, &w->cell, axis, planes[j + i], left[i], right[i] + in_plane, false);
            }
        }
    }
}

RTI_INLINE int rti_kd_bin_of(const rti_kdgrid *grid, int axis, float x)
{
    int bin = (int)((x - grid->origin[axis]) * grid->scale[axis]);
    return bin < 0 ? 0 : bin < RTI_KD_BINS ? bin : RTI_KD_BINS - 1;
}

static rti_kdgrid rti_kd_make_grid(const rti_box *cell)
{
    rti_kdgrid grid;
    int k;
    memset(&grid, 0, sizeof grid);
    for (k = 0; k < 3; k++) {
        float size = cell->hi[k] - cell->lo[k];
        grid.origin[k] = cell->lo[k];
        grid.end[k] = cell->hi[k];
        grid.scale[k] = size > 1e-34f ? (float)RTI_KD_BINS / size : 0;          /* below, the quotient could overflow */
    }
    return grid;
}

static void rti_kd_count(const rti_kdgrid *grid, const rti_ref *refs, size_t count, rti_kdbins *bins)
{
    size_t i;
    memset(bins, 0, sizeof *bins);
    for (i = 0; i < count; i++) {
#if RTI_X86                                  /* the fourth lanes, ids that would be slow as floats, masked away */
        const __m128 xyz = _mm_castsi128_ps(_mm_set_epi32(0, -1, -1, -1)), most = _mm_set1_ps(RTI_KD_BINS - 1);
        const __m128 origin = _mm_loadu_ps(grid->origin), scale = _mm_loadu_ps(grid->scale), end = _mm_loadu_ps(grid->end);
        const __m128 lo = _mm_and_ps(_mm_loadu_ps(refs[i].lo), xyz), hi = _mm_and_ps(_mm_loadu_ps(refs[i].hi), xyz);
        const __m128i a = _mm_cvttps_epi32(_mm_min_ps(_mm_max_ps(_mm_mul_ps(_mm_sub_ps(lo, origin), scale), _mm_setzero_ps()), most));
        const __m128i c = _mm_cvttps_epi32(_mm_min_ps(_mm_max_ps(_mm_mul_ps(_mm_sub_ps(hi, origin), scale), _mm_setzero_ps()), most));
        const int lower = _mm_movemask_ps(_mm_cmple_ps(hi, origin)) & 7, upper = _mm_movemask_ps(_mm_cmple_ps(end, lo)) & 7;
        if (RTI_UNLIKELY(lower | upper)) {
            int axis;
            for (axis = 0; axis < 3; axis++) {
                bins->walls[0][axis] += (uint32_t)(lower >> axis & 1);
                bins->walls[1][axis] += (uint32_t)(upper >> axis & 1);
            }
        }
        bins->starts[0][_mm_extract_epi16(a, 0)]++;
        bins->starts[1][_mm_extract_epi16(a, 2)]++;
        bins->starts[2][_mm_extract_epi16(a, 4)]++;
        bins->ends[0][_mm_extract_epi16(c, 0)]++;
        bins->ends[1][_mm_extract_epi16(c, 2)]++;
        bins->ends[2][_mm_extract_epi16(c, 4)]++;
#else
        int axis;
        for (axis = 0; axis < 3; axis++) {
            bins->starts[axis][rti_kd_bin_of(grid, axis, refs[i].lo[axis])]++;
            bins->ends[axis][rti_kd_bin_of(grid, axis, refs[i].hi[axis])]++;
            bins->walls[0][axis] += refs[i].hi[axis] <= grid->origin[axis];
            bins->walls[1][axis] += refs[i].lo[axis] >= grid->end[axis];
        }
#endif
    }
}

/* The best plane between bins: bin is the one above it, *left and *right count what begins below bin - 1 and ends above bin. */
static bool rti_kd_best_bin(const rti_kdgrid *grid, const rti_kdbins *bins, size_t count, const rti_kdwork *w, const rti_kdcost *cost,
                            rti_kdplane *best, int *bin, float *left, float *right)
{
    bool found = false;
    int axis, i;
    for (axis = 0; axis < 3; axis++) {
        uint32_t begun = 0, ended = 0;
        if (!(grid->scale[axis] > 0)) continue;
        for (i = 1; i < RTI_KD_BINS; i++) {
            const float before = best->cost;
            begun += bins->starts[axis][i - 1];
            ended += bins->ends[axis][i - 1];
            rti_kd_offer(best, cost, &w->cell, axis, grid->origin[axis] + (float)i / grid->scale[axis], (float)begun,
                         (float)(count - ended), true);
            if (best->cost < before) {
                found = true;
                *bin = i;
                *left = (float)(begun - bins->starts[axis][i - 1]);
                *right = (float)(count - ended - bins->ends[axis][i]);
            }
        }
    }
    return found;
}

/* The two bins around a plane again, in finer ones, with the first and the last beginning or end in each. */
RTI_INLINE rti_kdgrid rti_kd_fine_grid(const rti_kdgrid *grid, int axis, int bin)
{
    rti_kdgrid fine = *grid;
    fine.origin[axis] = grid->origin[axis] + (float)(bin - 1) / grid->scale[axis];
    fine.scale[axis] = grid->scale[axis] * ((float)RTI_KD_BINS / 2);
    return fine;
}
RTI_INLINE void rti_kd_put(rti_kdfine *f, float x, uint32_t starts, uint32_t ends, bool flat)
{
    f->starts += starts;
    f->ends += ends;
    if (x < f->first) {
        f->first = x;
        f->first_ends = 0;
    }
    if (x > f->last) {
        f->last = x;
        f->last_starts = 0;
    }
    if (flat) return;
    if (x <= f->first) f->first_ends += ends;
    if (x >= f->last) f->last_starts += starts;
}
static void rti_kd_count_fine(const rti_kdgrid *grid, int axis, int bin, const rti_ref *refs, size_t count, rti_kdfine f[RTI_KD_BINS])
{
    const rti_kdgrid fine = rti_kd_fine_grid(grid, axis, bin);
    size_t i;
    memset(f, 0, RTI_KD_BINS * sizeof *f);
    for (i = 0; i < RTI_KD_BINS; i++) {
        f[i].first = RTI_INFINITY;
        f[i].last = -RTI_INFINITY;
    }
    for (i = 0; i < count; i++) {
        const float lo = refs[i].lo[axis], hi = refs[i].hi[axis];
        const unsigned a = (unsigned)(rti_kd_bin_of(grid, axis, lo) - bin + 1), c = (unsigned)(rti_kd_bin_of(grid, axis, hi) - bin + 1);
        if (a < 2) rti_kd_put(&f[rti_kd_bin_of(&fine, axis, lo)], lo, 1, 0, lo >= hi);
        if (c < 2) rti_kd_put(&f[rti_kd_bin_of(&fine, axis, hi)], hi, 0, 1, lo >= hi);
    }
}

static void rti_kd_merge_fine(rti_kdfine *f, const rti_kdfine *more)
{
    f->starts += more->starts;
    f->ends += more->ends;
    if (more->first < f->first) {
        f->first = more->first;
        f->first_ends = 0;
    }
    if (more->last > f->last) {
        f->last = more->last;
        f->last_starts = 0;
    }
    if (more->first <= f->first) f->first_ends += more->first_ends;
    if (more->last >= f->last) f->last_starts += more->last_starts;
}

/* Between two starts or ends the cost is linear: least at one of them. So each boundary of bins stands for the last one below it and the
   first one above it. What starts at the plane itself is not below it, and what ends there not above; flat ones in it go below or above. */
static void rti_kd_best_fine(const rti_kdfine f[RTI_KD_BINS], int axis, float left, float right, const rti_kdwork *w,
                             const rti_kdcost *cost, rti_kdplane *best)
{
    int i, last = -1, first[RTI_KD_BINS + 1];
    first[RTI_KD_BINS] = RTI_KD_BINS;
    for (i = RTI_KD_BINS; i-- > 0;) {
        first[i] = f[i].starts + f[i].ends ? i : first[i + 1];
        right += (float)f[i].ends;
    }
    for (i = 0; i <= RTI_KD_BINS; i++) {
        if (last >= 0) rti_kd_offer(best, cost, &w->cell, axis, f[last].last, left - (float)f[last].last_starts, right, true);
        if (first[i] < RTI_KD_BINS)
            rti_kd_offer(best, cost, &w->cell, axis, f[first[i]].first, left, right - (float)f[first[i]].first_ends, false);
        if (i == RTI_KD_BINS) break;
        left += (float)f[i].starts;
        right -= (float)f[i].ends;
        if (f[i].starts + f[i].ends) last = i;
    }
}

static void rti_kd_chunk_count(void *context, size_t i)
{
    rti_kdbuilder *b = (rti_kdbuilder *)context;
    size_t first = i * RTI_CHUNK, left = b->work->count - first;
    rti_kd_count(b->grid, b->work->refs + first, left < RTI_CHUNK ? left : RTI_CHUNK, &b->chunks[i].bins);
}
static void rti_kd_chunk_fine(void *context, size_t i)
{
    rti_kdbuilder *b = (rti_kdbuilder *)context;
    size_t first = i * RTI_CHUNK, left = b->work->count - first;
    rti_kd_count_fine(b->grid, b->axis, b->bin, b->work->refs + first, left < RTI_CHUNK ? left : RTI_CHUNK, b->chunks[i].fine);
}

/* The best plane through w; false: w is better a leaf. chunked is b itself where no other task uses it: to count in parallel; else NULL. */
static bool rti_kd_plane(const rti_kdbuilder *b, const rti_kdwork *w, rti_kdbuilder *chunked, rti_kdplane *best)
{
    rti_kdcost cost;
    memset(best, 0, sizeof *best);
    best->cost = (float)w->count;           /* as a leaf */
    if ((float)w->count <= b->traversal || w->depth >= b->max_depth || !rti_kd_cost(b, &w->cell, &cost)) return false;
    cost.budget = (float)w->budget;
    if (w->count <= b->few) rti_kd_try_all(w, &cost, best);
    else {
        const rti_kdgrid grid = rti_kd_make_grid(&w->cell);
        const size_t chunks = chunked ? rti_chunk_total(w->count) : 1;
        rti_kdbins bins;
        rti_kdfine fine[RTI_KD_BINS];
        bool found;
        float left = 0, right = 0;
        size_t i;
        int axis, bin = 0, k;
        if (chunked) {
            chunked->work = w;
            chunked->grid = &grid;
            rti_for(b->opt->parallel_for, b->opt->parallel_user, chunks, rti_kd_chunk_count, chunked);
            bins = b->chunks[0].bins;
            for (i = 1; i < chunks; i++)
                for (axis = 0; axis < 3; axis++) {
                    for (k = 0; k < RTI_KD_BINS; k++) {
                        bins.starts[axis][k] += b->chunks[i].bins.starts[axis][k];
                        bins.ends[axis][k] += b->chunks[i].bins.ends[axis][k];
                    }
                    bins.walls[0][axis] += b->chunks[i].bins.walls[0][axis];
                    bins.walls[1][axis] += b->chunks[i].bins.walls[1][axis];
                }
        } else rti_kd_count(&grid, w->refs, w->count, &bins);
        found = rti_kd_best_bin(&grid, &bins, w->count, w, &cost, best, &bin, &left, &right);
        axis = best->axis;
        for (k = 0; k < 6; k++)
            rti_kd_offer_wall(best, &cost, &w->cell, k % 3, k / 3, (float)bins.walls[k / 3][k % 3],
                              (float)(w->count - bins.walls[k / 3][k % 3]));
        if (!found) return best->cost < (float)w->count;
        if (chunked) {
            chunked->axis = axis;
            chunked->bin = bin;
            rti_for(b->opt->parallel_for, b->opt->parallel_user, chunks, rti_kd_chunk_fine, chunked);
            memcpy(fine, b->chunks[0].fine, sizeof fine);
            for (i = 1; i < chunks; i++)
                for (k = 0; k < RTI_KD_BINS; k++) rti_kd_merge_fine(&fine[k], &b->chunks[i].fine[k]);
        } else rti_kd_count_fine(&grid, axis, bin, w->refs, w->count, fine);
        rti_kd_best_fine(fine, axis, left, right, w, &cost, best);
    }
    return best->cost < (float)w->count;
}

/* ---- clipping */

typedef struct { double x[3]; } rti_kdpoint;

/* Sutherland-Hodgman: what of the polygon lies on the side of the plane (sign 1: below it). Returns the number of corners. */
static int rti_kd_cut(const rti_kdpoint *from, int n, int axis, double at, double sign, rti_kdpoint *to)
{
    int i, k, m = 0;
    for (i = 0; i < n; i++) {
        const rti_kdpoint *p = &from[i], *q = &from[i + 1 < n ? i + 1 : 0];
        double dp = (at - p->x[axis]) * sign, dq = (at - q->x[axis]) * sign;
        if (dp >= 0) to[m++] = *p;
        if ((dp > 0 && dq < 0) || (dp < 0 && dq > 0)) {
            double t = dp / (dp - dq);
            for (k = 0; k < 3; k++) to[m].x[k] = p->x[k] + (q->x[k] - p->x[k]) * t;
            to[m++].x[axis] = at;
        }
    }
    return m;
}

/* Shrinks ref to the bounds of what of the polygon lies on the side of the plane; false: at most touches it from there. */
static bool rti_kd_half(const rti_kdpoint *corners, int n, int axis, double at, double room, double sign, rti_ref *ref)
{
    double lo[3] = { HUGE_VAL, HUGE_VAL, HUGE_VAL }, hi[3] = { -HUGE_VAL, -HUGE_VAL, -HUGE_VAL };
    bool inside = false;
    int i, k;
    for (i = 0; i < n; i++) {
        const rti_kdpoint *p = &corners[i], *q = &corners[i + 1 < n ? i + 1 : 0];
        const double d = (at - p->x[axis]) * sign, dp = d + room, dq = (at - q->x[axis]) * sign + room;
        inside |= d > 0;
        if (dp >= 0)
            for (k = 0; k < 3; k++) {
                lo[k] = p->x[k] < lo[k] ? p->x[k] : lo[k];
                hi[k] = p->x[k] > hi[k] ? p->x[k] : hi[k];
            }
        if ((dp > 0 && dq < 0) || (dp < 0 && dq > 0)) {
            const double t = dp / (dp - dq);
            for (k = 0; k < 3; k++) {
                const double x = p->x[k] + (q->x[k] - p->x[k]) * t;
                lo[k] = x < lo[k] ? x : lo[k];
                hi[k] = x > hi[k] ? x : hi[k];
            }
        }
    }
    if (inside)
        for (k = 0; k < 3; k++) {           /* rounded outwards */
            const float low = rti_float_down(lo[k]), high = rti_float_up(hi[k]);
            float a = low > ref->lo[k] ? low : ref->lo[k], b = high < ref->hi[k] ? high : ref->hi[k];
            ref->lo[k] = a < ref->hi[k] ? a : ref->hi[k];
            ref->hi[k] = b > ref->lo[k] ? b : ref->lo[k];
        }
    return inside;
}

/* Cuts a ref that lies on both sides of plane: sides[0] and sides[1], and which of them are left, as bits. A triangle is clipped to the
   cell, then to either side. Where a clipped corner is, double arithmetic knows to about 2^-50 of the largest coordinate; every plane is
   moved out by 2^-40 of it, so what is found contains what is there, and as boxes are cut at the cell's own planes again, no more. A
   ball is cut as its box; a side that its surface does not reach is left out, with room for rounding likewise. */
static int rti_kd_clip(const rt_geometry *geo, const rti_box *cell, const rti_kdplane *plane, const rti_ref *ref, rti_ref sides[2])
{
    const int axis = plane->axis;
    int side, k, left = 0;
    sides[0] = sides[1] = *ref;
    sides[0].hi[axis] = sides[1].lo[axis] = plane->at;
    if (ref->kind == RTI_TRIANGLE) {
        rti_kdpoint corners[2][10];
        float v[9];
        double room = 0;
        int n = 3, now = 0;
        (void)rti_fetch_triangle(geo, ref->prim, v);
        for (k = 0; k < 9; k++) {
            double size = fabs((double)v[k]);
            corners[0][k / 3].x[k % 3] = (double)v[k];
            if (size > room) room = size;
        }
        room *= 9.094947e-13;               /* 2^-40 */
        for (k = 0; k < 3; k++) {
            const float least = v[k] < v[3 + k] ? (v[k] < v[6 + k] ? v[k] : v[6 + k]) : (v[3 + k] < v[6 + k] ? v[3 + k] : v[6 + k]);
            const float most = v[k] > v[3 + k] ? (v[k] > v[6 + k] ? v[k] : v[6 + k]) : (v[3 + k] > v[6 + k] ? v[3 + k] : v[6 + k]);
            if (most > cell->hi[k]) {
                n = rti_kd_cut(corners[now], n, k, (double)cell->hi[k] + room, 1, corners[1 - now]);
                now = 1 - now;
            }
            if (least < cell->lo[k]) {
                n = rti_kd_cut(corners[now], n, k, (double)cell->lo[k] - room, -1, corners[1 - now]);
                now = 1 - now;
            }
        }
        if (!n) return 3;                   /* rounding left nothing of it: the box decides */
        for (side = 0; side < 2; side++)
            if (rti_kd_half(corners[now], n, axis, (double)plane->at, room, side ? -1 : 1, &sides[side])) left |= 1 << side;
        return left ? left : 1;             /* all in the plane */
    }
#if RTI_SPHERES
    if (ref->kind == RTI_SPHERE) {
        rti_ball ball;
        ball.prim = ref->prim;
        rti_fill_ball(&ball, geo);
        for (side = 0; side < 2; side++) {
            double nearest = 0, farthest = 0, r = (double)ball.radius;
            for (k = 0; k < 3; k++) {
                double c = (double)ball.center[k], lo = (double)sides[side].lo[k] - c, hi = (double)sides[side].hi[k] - c;
                double least = lo > 0 ? lo : hi < 0 ? hi : 0, most = -lo > hi ? lo : hi;
                nearest += least * least;
                farthest += most * most;
            }
            if (nearest <= r * r * (1 + 1e-9) && farthest >= r * r * (1 - 1e-9)) left |= 1 << side;
        }
        return left ? left : 3;
    }
#endif
    return 3;
}

/* Distributes refs over both sides; rights may be where refs are, since it never overtakes them. Stable. */
static void rti_kd_partition(const rt_geometry *geo, const rti_box *cell, const rti_kdplane *plane, const rti_ref *refs, size_t count,
                             rti_ref *lefts, rti_ref *rights, size_t *left_count, size_t *right_count)
{
    const int axis = plane->axis;
    size_t i, left = 0, right = 0;
    for (i = 0; i < count; i++) {
        const rti_ref ref = refs[i];
        const bool below = ref.lo[axis] < plane->at, above = ref.hi[axis] > plane->at;
        if (below && above) {
            rti_ref sides[2];
            int kept = rti_kd_clip(geo, cell, plane, &ref, sides);
            lefts[left] = sides[0];
            left += (size_t)kept & 1;
            rights[right] = sides[1];
            right += (size_t)kept >> 1;
        } else {
            const bool to_left = below || (!above && plane->planar_left);
            lefts[left] = ref;
            left += to_left;
            rights[right] = ref;
            right += !to_left;
        }
    }
    *left_count = left;
    *right_count = right;
}

/* The two halves of w, but for their refs: they share what it may use. */
static void rti_kd_share(const rti_kdwork *w, const rti_kdplane *plane, size_t left, size_t right, rti_kdwork parts[2])
{
    const size_t used = left + right + (left && right ? 0 : 1), spare = w->budget > used ? w->budget - used : 0;
    parts[0] = parts[1] = *w;
    parts[0].count = left;
    parts[1].count = right;
    parts[0].budget = left + (left ? (size_t)((double)spare * ((double)left / (double)(left + right))) : 0);
    parts[1].budget = right + (right ? left + spare - parts[0].budget : 0);
    parts[0].depth = parts[1].depth = w->depth + 1;
    parts[0].cell.hi[plane->axis] = parts[1].cell.lo[plane->axis] = plane->at;
}

/* Is there budget for a split? Clipping can only make its parts smaller. */
static bool rti_kd_affords(const rti_kdwork *w, const rti_kdplane *plane)
{
    size_t i, below = 0, above = 0, both = 0;
    if (2 * w->count < w->budget) return true;
    for (i = 0; i < w->count; i++) {
        const bool left = w->refs[i].lo[plane->axis] < plane->at, right = w->refs[i].hi[plane->axis] > plane->at;
        below += left;
        above += right;
        both += left && right;
    }
    return w->count + both + (below && above ? 0 : 1) <= w->budget;
}

/* ---- leaves and tasks */

static void rti_kd_set_inner(rti_kdnode *node, const rti_kdplane *plane, size_t children)
{
    node->as.split = plane->at;
    node->word = (uint32_t)(children / 2) << RTI_KD_PAIR | (uint32_t)plane->axis;
}

/* A leaf of refs, whose prims are appended to out; grouped by kind where the geometry has several. */
static void rti_kd_set_leaf(const rti_kdbuilder *b, rti_kdblock *out, rti_kdnode *node, const rti_ref *refs, size_t count)
{
    uint32_t kind = (uint32_t)RTI_TRIANGLE, k;
    size_t i, first = out->prim_count;
    if (count) kind = refs[0].kind;
    if (b->mixed) {
        for (i = 0; i < count; i++)
            if (refs[i].kind != kind) kind = RTI_MIXED;
        for (k = 0; k < RTI_KINDS; k++)
            for (i = 0; i < count; i++)
                if (refs[i].kind == k) out->prims[out->prim_count++] = refs[i].prim;
    } else
        for (i = 0; i < count; i++) out->prims[out->prim_count++] = refs[i].prim;
    node->as.count = kind << RTI_KIND_SHIFT | (uint32_t)count;
    node->word = (uint32_t)first << 2 | RTI_LEAF;
}

/* Builds the whole subtree of a lane's work. Refs of nodes that wait lie below those of the current one. */
static void rti_kd_run_lane(void *context, size_t index)
{
    const rti_kdbuilder *b = (const rti_kdbuilder *)context;
    rti_kdlane *lane = &b->lanes[index];
    rti_kdwork stack[RTI_MAX_DEPTH + 1], parts[2];
    rti_kdplane plane;
    int top = 0;
    memcpy(lane->refs, lane->work.refs, lane->work.count * sizeof(rti_ref));
    stack[0] = lane->work;
    stack[0].refs = lane->refs;
    stack[top++].node = 0;
    lane->out.node_count = 2;
    lane->out.prim_count = 0;
    while (top) {
        rti_kdwork w = stack[--top];
        size_t left, right;
        if (!rti_kd_plane(b, &w, NULL, &plane) || !rti_kd_affords(&w, &plane)) {
            rti_kd_set_leaf(b, &lane->out, &lane->out.nodes[w.node], w.refs, w.count);
            continue;
        }
        rti_kd_partition(b->geo, &w.cell, &plane, w.refs, w.count, lane->spare, w.refs, &left, &right);
        rti_kd_share(&w, &plane, left, right, parts);
        memcpy(w.refs + right, lane->spare, left * sizeof(rti_ref));
        parts[0].refs = w.refs + right;
        parts[0].node = (uint32_t)lane->out.node_count;
        parts[1].node = parts[0].node + 1;
        rti_kd_set_inner(&lane->out.nodes[w.node], &plane, lane->out.node_count);
        lane->out.node_count += 2;
        stack[top++] = parts[1];
        stack[top++] = parts[0];
    }
}

/* ---- the top of the tree */

/* Room for one more: *array is moved to one twice as large when it is full. */
static bool rti_kd_enlarge(void **array, size_t *limit, size_t count, size_t size, void *user)
{
    void *more;
    if (count < *limit) return true;
    more = rti_alloc(*limit ? 2 * *limit : 64, size, user);
    if (!more) return false;
    if (*array) memcpy(more, *array, count * size);
    rti_release(*array, user);
    *array = more;
    *limit = *limit ? 2 * *limit : 64;
    return true;
}

static bool rti_kd_new_block(rti_kdbuilder *b, uint32_t node, size_t nodes, size_t prims)
{
    void *array = b->blocks, *user = b->opt->memory_user;
    rti_kdblock *block;
    bool grown = rti_kd_enlarge(&array, &b->block_limit, b->block_count, sizeof(rti_kdblock), user);
    b->blocks = (rti_kdblock *)array;
    if (!grown) return false;
    block = &b->blocks[b->block_count++];
    block->nodes = (rti_kdnode *)rti_alloc(nodes, sizeof(rti_kdnode), user);
    block->prims = (uint32_t *)rti_alloc(prims, sizeof(uint32_t), user);
    block->node_count = nodes;
    block->prim_count = prims;
    block->node = node;
    return block->nodes && block->prims;
}

static bool rti_kd_run_lanes(rti_kdbuilder *b, size_t count)
{
    size_t i;
    rti_for(b->opt->parallel_for, b->opt->parallel_user, count, rti_kd_run_lane, b);
    for (i = 0; i < count; i++) {
        rti_kdlane *lane = &b->lanes[i];
        rti_kdblock *block;
        if (!rti_kd_new_block(b, lane->work.node, lane->out.node_count, lane->out.prim_count)) return false;
        block = &b->blocks[b->block_count - 1];
        memcpy(block->nodes, lane->out.nodes, block->node_count * sizeof(rti_kdnode));
        memcpy(block->prims, lane->out.prims, block->prim_count * sizeof(uint32_t));
    }
    for (i = 0; i < count; i++) {
        rti_release(b->lanes[i].work.refs, b->opt->memory_user);
        b->lanes[i].work.refs = NULL;
    }
    return true;
}

static void rti_kd_chunk_partition(void *context, size_t i)
{
    rti_kdbuilder *b = (rti_kdbuilder *)context;
    size_t first = i * RTI_CHUNK, left = b->work->count - first;
    rti_kd_partition(b->geo, &b->work->cell, b->plane, b->work->refs + first, left < RTI_CHUNK ? left : RTI_CHUNK, b->spare + 2 * first,
                     b->spare + 2 * first + (left < RTI_CHUNK ? left : RTI_CHUNK), &b->chunks[i].left, &b->chunks[i].right);
}

/* Splits w, whose refs are its own allocation, into parts with theirs; w's are released. */
static bool rti_kd_split(rti_kdbuilder *b, rti_kdwork *w, const rti_kdplane *plane, rti_kdwork parts[2])
{
    void *user = b->opt->memory_user;
    const size_t chunks = rti_chunk_total(w->count);
    size_t i, left = 0, right = 0;
    b->work = w;
    b->plane = plane;
    rti_for(b->opt->parallel_for, b->opt->parallel_user, chunks, rti_kd_chunk_partition, b);
    for (i = 0; i < chunks; i++) {
        left += b->chunks[i].left;
        right += b->chunks[i].right;
    }
    rti_kd_share(w, plane, left, right, parts);
    rti_release(w->refs, user);
    w->refs = NULL;
    parts[0].refs = (rti_ref *)rti_alloc(left, sizeof(rti_ref), user);
    parts[1].refs = (rti_ref *)rti_alloc(right, sizeof(rti_ref), user);
    if (!parts[0].refs || !parts[1].refs) {
        rti_release(parts[0].refs, user);
        rti_release(parts[1].refs, user);
        return false;
    }
    left = right = 0;
    for (i = 0; i < chunks; i++) {
        const size_t first = i * RTI_CHUNK, rest = w->count - first, n = rest < RTI_CHUNK ? rest : RTI_CHUNK;
        memcpy(parts[0].refs + left, b->spare + 2 * first, b->chunks[i].left * sizeof(rti_ref));
        memcpy(parts[1].refs + right, b->spare + 2 * first + n, b->chunks[i].right * sizeof(rti_ref));
        left += b->chunks[i].left;
        right += b->chunks[i].right;
    }
    return true;
}

/* Fills top and blocks. root's refs, like those of every node here, are an allocation of their own. */
static bool rti_kd_build_top(rti_kdbuilder *b, const rti_kdwork *root)
{
    void *user = b->opt->memory_user;
    rti_kdwork stack[RTI_MAX_DEPTH + 1], parts[2];
    rti_kdplane plane;
    size_t waiting = 0;
    int top = 0;
    bool good = true;
    stack[top++] = *root;
    b->top_count = 2;
    while (top && good) {
        rti_kdwork w = stack[--top];
        if (w.count <= RTI_KD_TASK) {
            b->lanes[waiting++].work = w;
        } else if (rti_kd_plane(b, &w, b, &plane) && rti_kd_affords(&w, &plane)) {
            void *array = b->top;
            good = rti_kd_enlarge(&array, &b->top_limit, b->top_count + 2, sizeof(rti_kdnode), user);
            b->top = (rti_kdnode *)array;
            if (!good || !(good = rti_kd_split(b, &w, &plane, parts))) {
                rti_release(w.refs, user);
                break;
            }
            rti_kd_set_inner(&b->top[w.node], &plane, b->top_count);
            parts[0].node = (uint32_t)b->top_count;
            parts[1].node = (uint32_t)b->top_count + 1;
            b->top_count += 2;
            stack[top++] = parts[1];
            stack[top++] = parts[0];
        } else {                            /* a great leaf: a block of its own, behind those of the lanes that wait */
            good = (!waiting || rti_kd_run_lanes(b, waiting)) && rti_kd_new_block(b, w.node, 2, w.count);
            if (good) {
                waiting = 0;
                rti_kdblock *block = &b->blocks[b->block_count - 1];
                block->prim_count = 0;
                rti_kd_set_leaf(b, block, &block->nodes[0], w.refs, w.count);
            }
            rti_release(w.refs, user);
        }
        if (good && waiting && (waiting == b->lane_count || !top)) {
            good = rti_kd_run_lanes(b, waiting);
            if (good) waiting = 0;
        }
    }
    while (top) rti_release(stack[--top].refs, user);
    while (waiting) rti_release(b->lanes[--waiting].work.refs, user);
    return good;
}

/* ---- the finished tree */

/* Joins top and blocks to kdnodes and kdslots, and fills the slots, in the order in which leaves first name them. */
static rt_status rti_kd_join(rt_accel *accel, const rti_kdbuilder *b)
{
    void *user = b->opt->memory_user;
    const size_t total = b->geo->triangle_count + rti_sphere_count(b->geo) + rti_instance_count(b->geo);
    size_t nodes = b->top_count, prims = 0, distinct = 0, i, k;
    uint32_t *slots = NULL, *order = NULL, next[RTI_KINDS] = { 0, 0, 0 };
    bool good;
    for (i = 0; i < b->block_count; i++) {
        nodes += b->blocks[i].node_count - 2;
        prims += b->blocks[i].prim_count;
    }
    accel->references = prims;
    accel->node_count = nodes;
    accel->kdnodes = (rti_kdnode *)rti_alloc(nodes, sizeof(rti_kdnode), user);
    for (i = 0; i < b->block_count; i++)    /* entries of leaves that need them */
        for (k = 0; k < b->blocks[i].node_count; k++) {
            const rti_kdnode *node = &b->blocks[i].nodes[k];
            const uint32_t count = node->as.count & RTI_COUNT_MASK;
            if (k != 1 && (node->word & 3) == RTI_LEAF && count > 1) accel->kdslot_count += count;
        }
    accel->kdslots = (uint32_t *)rti_alloc(accel->kdslot_count, sizeof(uint32_t), user);
    slots = (uint32_t *)rti_alloc(total, sizeof(uint32_t), user);           /* of each primitive, */
    order = (uint32_t *)rti_alloc(total, sizeof(uint32_t), user);           /* and the primitives in the order of their slots */
    good = accel->kdnodes && accel->kdslots && slots && order;
    if (good) {
        memset(slots, 0xff, total * sizeof(uint32_t));
        memcpy(accel->kdnodes, b->top, b->top_count * sizeof(rti_kdnode));
        accel->kdnodes[1].as.count = 0;     /* never visited; but no byte of the tree is left to chance */
        accel->kdnodes[1].word = RTI_LEAF;
        nodes = b->top_count;
        accel->kdslot_count = 0;
        for (i = 0; i < b->block_count; i++) {
            const rti_kdblock *block = &b->blocks[i];
            for (k = 0; k < block->node_count; k++) {
                rti_kdnode node = block->nodes[k];
                if (k == 1) continue;
                if ((node.word & 3) != RTI_LEAF) node.word += (uint32_t)(nodes / 2 - 1) << RTI_KD_PAIR;
                else {
                    const uint32_t *from = block->prims + (node.word >> 2), count = node.as.count & RTI_COUNT_MASK;
                    uint32_t n, entry = 0;
                    node.word = (uint32_t)accel->kdslot_count << 2 | RTI_LEAF;
                    for (n = 0; n < count; n++) {
                        const int kind = rti_kind_of(b->geo, from[n]);
                        if (slots[from[n]] == RT_NONE) {
                            slots[from[n]] = (uint32_t)kind << RTI_KIND_SHIFT | next[kind]++;
                            order[distinct++] = from[n];
                        }
                        entry = slots[from[n]];
                        if (count > 1) accel->kdslots[accel->kdslot_count++] = entry;
                    }
                    if (count == 1) node.word = (entry & RTI_COUNT_MASK) << 2 | RTI_LEAF;
                }
                accel->kdnodes[k ? nodes - 2 + k : block->node] = node;
            }
            nodes += block->node_count - 2;
        }
        accel->bytes += nodes * sizeof(rti_kdnode) + accel->kdslot_count * sizeof(uint32_t);
        good = rti_fill_slots(accel, b->geo, b->opt, order, 1, distinct);
    }
    rti_release(slots, user);
    rti_release(order, user);
    return good ? RT_OK : RT_ERROR_MEMORY;
}

/* Depth, which children are empty, and, unless they are left out, the box and the parent of every pair of children. */
static bool rti_kd_link(rt_accel *accel, const rt_build_options *opt)
{
    struct { uint32_t node; int depth; float bounds[6]; } stack[RTI_MAX_DEPTH + 1];
    int top = 0, k;
    if (!opt->no_backtrack) {
        accel->kdlinks = (rti_kdlink *)rti_alloc(accel->node_count / 2, sizeof(rti_kdlink), opt->memory_user);
        if (!accel->kdlinks) return false;
        accel->bytes += accel->node_count / 2 * sizeof(rti_kdlink);
        memset(accel->kdlinks, 0, sizeof(rti_kdlink));
    }
    stack[0].node = 0;
    stack[0].depth = 0;
    for (k = 0; k < 3; k++) {
        stack[0].bounds[k] = accel->lower[k];
        stack[0].bounds[3 + k] = accel->upper[k];
    }
    top = 1;
    while (top) {
        const uint32_t at = stack[--top].node;
        rti_kdnode *node = &accel->kdnodes[at];
        const int depth = stack[top].depth, axis = (int)(node->word & 3);
        const uint32_t child = rti_kd_children(node);
        if (depth > accel->depth) accel->depth = depth;
        if (axis == (int)RTI_LEAF) continue;
        for (k = 0; k < 2; k++)
            if (rti_kd_empty(&accel->kdnodes[child + (uint32_t)k])) node->word |= k ? RTI_KD_UPPER_EMPTY : RTI_KD_LOWER_EMPTY;
        if (accel->kdlinks) {
            memcpy(accel->kdlinks[child / 2].bounds, stack[top].bounds, sizeof stack[top].bounds);
            accel->kdlinks[child / 2].parent = at;
        }
        stack[top + 1] = stack[top];
        stack[top].node = child + 1;
        stack[top].bounds[axis] = node->as.split;
        stack[top++].depth = depth + 1;
        stack[top].node = child;
        stack[top].bounds[3 + axis] = node->as.split;
        stack[top++].depth = depth + 1;
    }
    return true;
}

/* Takes over *refs, which is released. */
static rt_status rti_build_kdtree(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt, rti_ref **refs, size_t count)
{
    void *user = opt->memory_user;
    const double duplication = opt->max_duplication >= 1 ? (double)opt->max_duplication : RTI_DUPLICATION;
    const size_t most = count < RTI_KD_TASK ? count : RTI_KD_TASK;
    const size_t room = (size_t)(duplication * (double)most) + RTI_MAX_DEPTH + 2;           /* shares are rounded once a level */
    const bool great = count > RTI_KD_TASK;
    rti_kdbuilder b;
    rti_kdwork root;
    rt_status status = RT_ERROR_MEMORY;
    size_t i;

    memset(&b, 0, sizeof b);
    memset(&root, 0, sizeof root);
    b.geo = geo;
    b.opt = opt;
    b.traversal = opt->traversal_cost > 0 ? opt->traversal_cost : 1;
    b.bonus = 1 - (opt->empty_bonus > 0 ? opt->empty_bonus : opt->empty_bonus < 0 ? 0 : 0.2f);
    b.few = opt->quality == RT_BUILD_FAST ? 8 : opt->quality == RT_BUILD_HIGH ? RTI_KD_FEW : RTI_KD_FEW / 2;
    b.max_depth = 16 + 2 * rti_ceil_log2(count) < RTI_MAX_DEPTH ? 16 + 2 * rti_ceil_log2(count) : RTI_MAX_DEPTH;
    b.mixed = (geo->triangle_count != 0) + (rti_sphere_count(geo) != 0) + (rti_instance_count(geo) != 0) > 1;
    root.refs = *refs;
    root.count = count;
    root.budget = (size_t)(duplication * (double)count);
    if (root.budget > RTI_MAX_REFERENCES) root.budget = count > RTI_MAX_REFERENCES ? count : RTI_MAX_REFERENCES;
    *refs = NULL;
    root.cell = rti_empty_box;
    for (i = 0; i < count; i++) rti_box_grow(&root.cell, root.refs[i].lo, root.refs[i].hi);
    memcpy(accel->lower, root.cell.lo, sizeof accel->lower);
    memcpy(accel->upper, root.cell.hi, sizeof accel->upper);

    b.lane_count = great && opt->parallel_for ? RTI_KD_LANES : 1;
    b.lanes = (rti_kdlane *)rti_alloc(b.lane_count, sizeof(rti_kdlane), user);
    b.top = (rti_kdnode *)rti_alloc(b.top_limit = 64, sizeof(rti_kdnode), user);
    b.spare = (rti_ref *)rti_alloc(great ? count : 1, 2 * sizeof(rti_ref), user);
    b.chunks = (rti_kdchunk *)rti_alloc(great ? rti_chunk_total(count) : 1, sizeof(rti_kdchunk), user);
    if (b.lanes) memset(b.lanes, 0, b.lane_count * sizeof(rti_kdlane));
    for (i = 0; b.lanes && i < b.lane_count; i++) {
        rti_kdlane *lane = &b.lanes[i];
        lane->refs = (rti_ref *)rti_alloc(room, sizeof(rti_ref), user);
        lane->spare = (rti_ref *)rti_alloc(most + 1, sizeof(rti_ref), user);
        lane->out.nodes = (rti_kdnode *)rti_alloc(2 * room + 2, sizeof(rti_kdnode), user);
        lane->out.prims = (uint32_t *)rti_alloc(room, sizeof(uint32_t), user);
        if (!lane->refs || !lane->spare || !lane->out.nodes || !lane->out.prims) goto out;
    }
    if (!b.lanes || !b.top || !b.spare || !b.chunks) goto out;
    {
        bool good = rti_kd_build_top(&b, &root);
        root.refs = NULL;
        if (!good) goto out;
    }
    rti_release(b.spare, user);
    b.spare = NULL;
    status = rti_kd_join(accel, &b);
    if (status == RT_OK && !rti_kd_link(accel, opt)) status = RT_ERROR_MEMORY;
out:
    rti_release(root.refs, user);
    for (i = 0; b.lanes && i < b.lane_count; i++) {
        rti_release(b.lanes[i].refs, user);
        rti_release(b.lanes[i].spare, user);
        rti_release(b.lanes[i].out.nodes, user);
        rti_release(b.lanes[i].out.prims, user);
    }
    for (i = 0; i < b.block_count; i++) {
        rti_release(b.blocks[i].nodes, user);
        rti_release(b.blocks[i].prims, user);
    }
    rti_release(b.lanes, user);
    rti_release(b.blocks, user);
    rti_release(b.top, user);
    rti_release(b.spare, user);
    rti_release(b.chunks, user);
    return status;
}

#endif /* RTI_KDTREE */

/* ---- >>slots -------------------------------------------------------------------------------------------------------- */

/* Are triangles in octets alone? Then those are the slots, some of them the same as others. */
RTI_INLINE bool rti_only_octets(const rt_accel *accel)
{
#if RTI_WIDES
    return accel->octets && !accel->triangles;
#else
    (void)accel;
    return false;
#endif
}

static size_t rti_slot_count(const rt_accel *accel, int kind)
{
#if RTI_WIDES
    if (kind == RTI_TRIANGLE && rti_only_octets(accel)) return accel->octet_count * RTI_CHILDREN;
#endif
    return accel->slots[kind];
}

static uint32_t rti_slot_prim(const rt_accel *accel, int kind, size_t slot)
{
#if RTI_WIDES
    if (kind == RTI_TRIANGLE && rti_only_octets(accel)) return accel->octets[slot / RTI_CHILDREN].prim[slot % RTI_CHILDREN];
#endif
    if (kind == RTI_TRIANGLE) return accel->triangles ? accel->triangles[slot].prim : accel->triangle_ids[slot];
#if RTI_SPHERES
    if (kind == RTI_SPHERE) return accel->balls ? accel->balls[slot].prim : accel->ball_ids[slot];
#endif
#if RTI_INSTANCES
    if (kind == RTI_INSTANCE) return accel->instances[slot].prim;
#endif
    return RT_NONE;
}

/* The leaf's primitives must be good. */
static rti_box rti_leaf_box(const rt_accel *accel, const rt_geometry *geo, const rti_node *leaf)
{
    rti_box box = rti_empty_box, prim_box;
    uint32_t i;
    int kind;
    for (i = 0; i < rti_leaf_count(leaf); i++) {
        (void)rti_prim_box(geo, rti_slot_prim(accel, rti_leaf_kind(leaf), leaf->index + i), &prim_box, &kind);
        rti_box_grow(&box, prim_box.lo, prim_box.hi);
    }
    return box;
}

/* ---- >>threaded ----------------------------------------------------------------------------------------------------- */

#if RTI_THREADED

/* [Lohr] 4. The binary tree of >>bvh is laid out depth first; nodes that do not pay are thrown back, which makes the others wider; then the
   stack of every walk is baked in: each node is told where to go on when it is hit, its first child, and when it is missed, what follows
   everything below it. To where the walk would end links point straight away ([Lohr]'s compression). Which child is first depends on where
   rays go: so there may be several lists of links, each for directions with certain signs, over the same nodes.

   To throw a child with two children of its own back to its parent saves one test for each ray in the parent and costs two for each that
   misses the child: it pays where the child's surface is more than half of the parent's. */
#define RTI_BRANCHING 4                     /* the defaults; measured, see tests/bench_lohr.h */
#define RTI_ORDERS 8
#define RTI_THROW_BACK 0.5

/* One node of the binary tree, depth first, its child at the lower end of axis next to it. */
typedef struct {
    rti_node node;
    uint32_t skip;                          /* what follows everything below it */
    uint32_t id;                            /* in accel->nodes; RT_NONE: thrown back */
    int axis;
} rti_twig;

typedef struct {
    rt_accel *accel;
    const rt_geometry *geo;
    const rti_node *binary;
    rti_twig *twigs;
    rti_link *links;                        /* of the order that is made, */
    unsigned reversed;                      /* and the axes along which it runs from the upper end, a bit each */
} rti_threader;

/* Lays out what is below a node from twig `at` on; answers the twig behind. Recursion as deep as the tree: at most RTI_MAX_DEPTH. */
static uint32_t rti_unfold(rti_threader *t, const rti_node *from, uint32_t at)
{
    rti_twig *twig = &t->twigs[at];
    twig->node = *from;
    twig->axis = 0;
    twig->skip = at + 1;
    if (!from->count) {
        const rti_node *a = t->binary + from->index, *b = a + 1;
        float farthest = -1;
        bool swap = false;
        int k;
        for (k = 0; k < 3; k++) {           /* halves first: the sum of two coordinates stays a float */
            const float d = (0.5f * b->bounds[k] + 0.5f * b->bounds[3 + k]) - (0.5f * a->bounds[k] + 0.5f * a->bounds[3 + k]);
            if (!(fabsf(d) > farthest)) continue;
            farthest = fabsf(d);
            twig->axis = k;
            swap = d < 0;
        }
        twig->skip = rti_unfold(t, swap ? a : b, rti_unfold(t, swap ? b : a, at + 1));
    }
    return twig->skip;
}

/* The points that a primitive's bounding sphere must hold: the corners of a triangle, or of an instance's box; 0: a sphere, which is ball.
   */
static int rti_prim_points(const rt_geometry *geo, uint32_t prim, double points[8][3], rt_sphere *ball)
{
    rti_box box;
    float v[9];
    int kind, i, k;
    if (prim < geo->triangle_count) {
        (void)rti_fetch_triangle(geo, prim, v);
        for (i = 0; i < 9; i++) points[i / 3][i % 3] = (double)v[i];
        return 3;
    }
#if RTI_SPHERES
    if (prim - geo->triangle_count < geo->sphere_count) {
        *ball = geo->spheres[prim - geo->triangle_count];
        return 0;
    }
#endif
    (void)ball;
    (void)rti_prim_box(geo, prim, &box, &kind);
    for (i = 0; i < 8; i++)
        for (k = 0; k < 3; k++) points[i][k] = (double)(i >> k & 1 ? box.hi[k] : box.lo[k]);
    return 8;
}

/* Centre x y z and radius of a sphere around the primitives of a leaf, which is at least that far from `from` what they need: grows *most.
   */
static void rti_reach_leaf(const rt_accel *accel, const rt_geometry *geo, const rti_node *leaf, const double from[3], double *most)
{
    uint32_t n;
    int i;
    for (n = 0; n < rti_leaf_count(leaf); n++) {
        double points[8][3], radius = 0;
        rt_sphere ball = { { 0, 0, 0 }, 0 };
        const int count = rti_prim_points(geo, rti_slot_prim(accel, rti_leaf_kind(leaf), leaf->index + n), points, &ball);
        if (!count) {
            points[0][0] = (double)ball.center.x;
            points[0][1] = (double)ball.center.y;
            points[0][2] = (double)ball.center.z;
            radius = (double)ball.radius;
        }
        for (i = 0; i < (count ? count : 1); i++) {
            const double x = points[i][0] - from[0], y = points[i][1] - from[1], z = points[i][2] - from[2];
            const double reach = sqrt(x * x + y * y + z * z) + radius;
            if (reach > *most) *most = reach;
        }
    }
}

/* The bounding sphere of a node from the leaves below it, [first, last) of every stride-th node, around the middle of box. A little
   larger, for the rounding of the test; see rti_meet_sphere. */
static void rti_set_sphere(const rt_accel *accel, const rt_geometry *geo, const char *first, const char *last, size_t stride,
                           const rti_box *box, float bounds[6])
{
    double center[3], most = 0;
    int k;
    for (k = 0; k < 3; k++) {
        bounds[k] = 0.5f * box->lo[k] + 0.5f * box->hi[k];
        center[k] = (double)bounds[k];
        bounds[3 + k] = 0;
    }
    for (; first < last; first += stride) {
        const rti_node *node = (const rti_node *)(const void *)first;
        if (node->count) rti_reach_leaf(accel, geo, node, center, &most);
    }
    bounds[3] = rti_float_up(most * 1.000002);
}

static double rti_surface(const rt_accel *accel, const rti_node *node)
{
    if (accel->bounds == RT_BOUNDS_SPHERES) return (double)node->bounds[3] * (double)node->bounds[3];
    return rti_node_area(node);
}

/* Throws back children of a kept node, the largest first, while they are larger than the part of it and there is room. */
static void rti_throw_back(rti_threader *t, uint32_t at, size_t branching, double part)
{
    uint32_t children[RT_MAX_BRANCHING];
    const double limit = part * rti_surface(t->accel, &t->twigs[at].node);
    size_t count = 2, i, largest;
    children[0] = at + 1;
    children[1] = t->twigs[at + 1].skip;
    while (count < branching) {
        double most = limit;
        for (i = 0, largest = count; i < count; i++) {
            const rti_node *child = &t->twigs[children[i]].node;
            const double surface = child->count ? 0 : rti_surface(t->accel, child);
            if (!child->count && surface >= most && (surface > most || largest == count)) {
                most = surface;
                largest = i;
            }
        }
        if (largest == count) break;
        t->twigs[children[largest]].id = RT_NONE;
        children[count++] = t->twigs[children[largest] + 1].skip;
        children[largest]++;
    }
}

/* Links what is below twig `at`, and then goes on at next; answers where that starts. Recursion as deep as the tree. */
static uint32_t rti_link_up(const rti_threader *t, uint32_t at, uint32_t next)
{
    const rti_twig *twig = &t->twigs[at];
    uint32_t first = next;
    if (!twig->node.count) {
        const uint32_t lower = at + 1, upper = t->twigs[lower].skip;
        const bool back = t->reversed >> twig->axis & 1;
        first = rti_link_up(t, back ? upper : lower, rti_link_up(t, back ? lower : upper, next));
    }
    if (twig->id == RT_NONE) return first;
    t->links[twig->id].hit = first;
    t->links[twig->id].miss = next;
    return twig->id;
}

/* From the binary tree in accel->nodes, whose slots are filled. */
static rt_status rti_thread(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt)
{
    const size_t n = accel->node_count, branching = opt->branching ? (size_t)opt->branching : RTI_BRANCHING;
    const double part = opt->throw_back != 0 ? (double)opt->throw_back : RTI_THROW_BACK;
    rti_node *nodes;
    rti_threader t;
    int axes[3] = { 0, 1, 2 }, o, i, j;
    uint32_t at, count = 0, ends[RTI_MAX_DEPTH + 1];
    accel->bounds = opt->bounds;
    accel->orders = opt->orders ? opt->orders : RTI_ORDERS;
    for (i = 0; i < 2; i++)                 /* the longest axes of the tree tell the orders apart */
        for (j = i + 1; j < 3; j++)
            if (accel->upper[axes[j]] - accel->lower[axes[j]] > accel->upper[axes[i]] - accel->lower[axes[i]]) {
                const int axis = axes[i];
                axes[i] = axes[j];
                axes[j] = axis;
            }
    memcpy(accel->order_axes, axes, sizeof axes);
    t.accel = accel;
    t.geo = geo;
    t.binary = accel->nodes;
    t.twigs = (rti_twig *)rti_alloc(n, sizeof *t.twigs, accel->memory_user);
    if (!t.twigs) return RT_ERROR_MEMORY;
    (void)rti_unfold(&t, t.binary, 0);
    for (at = 0; at < n; at++) {
        rti_twig *twig = &t.twigs[at];
        twig->id = 0;
        if (accel->bounds == RT_BOUNDS_SPHERES) {
            rti_box box;
            memcpy(box.lo, twig->node.bounds, 3 * sizeof(float));
            memcpy(box.hi, twig->node.bounds + 3, 3 * sizeof(float));
            rti_set_sphere(accel, geo, (const char *)twig, (const char *)(t.twigs + twig->skip), sizeof *twig, &box, twig->node.bounds);
        }
    }
    accel->depth = 0;
    for (at = 0; at < n; at++) {            /* parents come before their children */
        rti_twig *twig = &t.twigs[at];
        if (twig->id == RT_NONE) continue;
        if (!twig->node.count && part > 0) rti_throw_back(&t, at, branching, part);
        twig->id = count++;
    }
    nodes = (rti_node *)rti_alloc(count, sizeof *nodes, accel->memory_user);
    accel->links = (rti_link *)rti_alloc(count, (size_t)accel->orders * sizeof *accel->links, accel->memory_user);
#if RTI_INSTANCES
    if (accel->slots[RTI_INSTANCE]) {
        accel->instance_nodes = (uint32_t *)rti_alloc(accel->slots[RTI_INSTANCE], sizeof(uint32_t), accel->memory_user);
        accel->bytes += accel->slots[RTI_INSTANCE] * sizeof(uint32_t);
    }
    if (accel->slots[RTI_INSTANCE] && !accel->instance_nodes) accel->node_count = 0;
#endif
    if (!nodes || !accel->links || !accel->node_count) {
        rti_release(nodes, accel->memory_user);
        rti_release(t.twigs, accel->memory_user);
        return RT_ERROR_MEMORY;
    }
    for (at = 0, i = 0; at < n; at++) {
        const rti_twig *twig = &t.twigs[at];
        if (twig->id == RT_NONE) continue;
        nodes[twig->id] = twig->node;
        if (!twig->node.count) nodes[twig->id].index = 0;
#if RTI_INSTANCES
        else if (rti_leaf_kind(&twig->node) == RTI_INSTANCE)
            for (j = 0; j < (int)rti_leaf_count(&twig->node); j++) accel->instance_nodes[twig->node.index + (uint32_t)j] = twig->id;
#endif
        while (i && ends[i - 1] <= at) i--;         /* the kept nodes around this one */
        if (i > accel->depth) accel->depth = i;
        if (!twig->node.count) ends[i++] = twig->skip;
    }
    for (o = 0; o < accel->orders; o++) {
        t.reversed = 0;
        for (i = 0; i < 3; i++)
            if (o >> i & 1) t.reversed |= 1u << axes[i];
        t.links = accel->links + (size_t)o * count;
        (void)rti_link_up(&t, 0, RTI_END);
    }
    rti_release(t.twigs, accel->memory_user);
    rti_release(accel->nodes, accel->memory_user);
    accel->bytes += count * (sizeof(rti_node) + (size_t)accel->orders * sizeof(rti_link)) - n * sizeof(rti_node);
    accel->nodes = nodes;
    accel->node_count = count;
    return RT_OK;
}

/* The sphere of an inner node from those of the leaves below it, nodes[at + 1] to nodes[end - 1], around the middle of their box. Spheres
   around spheres of inner nodes would grow at each level. */
static void rti_set_outer_sphere(rti_node *nodes, size_t at, size_t end, rti_box *box)
{
    float *sphere = nodes[at].bounds;
    double most = 0;
    size_t i;
    int k;
    for (i = at + 1; i < end; i++) {
        const float *b = nodes[i].bounds;
        const float lo[4] = { b[0] - b[3], b[1] - b[3], b[2] - b[3], 0 }, hi[4] = { b[0] + b[3], b[1] + b[3], b[2] + b[3], 0 };
        if (nodes[i].count) rti_box_grow(box, lo, hi);
    }
    for (k = 0; k < 3; k++) sphere[k] = 0.5f * box->lo[k] + 0.5f * box->hi[k];
    for (i = at + 1; i < end; i++) {
        const double x = (double)nodes[i].bounds[0] - (double)sphere[0], y = (double)nodes[i].bounds[1] - (double)sphere[1];
        const double z = (double)nodes[i].bounds[2] - (double)sphere[2], reach = nodes[i].count ? sqrt(x * x + y * y + z * z) : 0;
        if (nodes[i].count && reach + (double)nodes[i].bounds[3] > most) most = reach + (double)nodes[i].bounds[3];
    }
    sphere[3] = rti_float_up(most * 1.0000005);
}

/* Bounds from the primitives, for >>refit: nodes stand in depth-first order, so backwards all that is below one is there. */
static void rti_rebound(rt_accel *accel, const rt_geometry *geo)
{
    const rti_link *const links = accel->links;
    rti_box whole = rti_empty_box;
    size_t i;
    int k;
    for (i = accel->node_count; i-- > 0;) {
        rti_node *node = &accel->nodes[i];
        const size_t end = links[i].miss == RTI_END ? accel->node_count : links[i].miss;
        rti_box box = rti_empty_box;
        size_t j;
        if (node->count) {
            box = rti_leaf_box(accel, geo, node);
            rti_box_grow(&whole, box.lo, box.hi);
            if (accel->bounds == RT_BOUNDS_SPHERES)
                rti_set_sphere(accel, geo, (const char *)node, (const char *)(node + 1), sizeof *node, &box, node->bounds);
            else rti_set_bounds(node, &box);
        } else if (accel->bounds == RT_BOUNDS_SPHERES) rti_set_outer_sphere(accel->nodes, i, end, &box);
        else {
            for (j = i + 1; j < end; j = links[j].miss == RTI_END ? accel->node_count : links[j].miss) {
                const float *b = accel->nodes[j].bounds;
                const float lo[4] = { b[0], b[1], b[2], 0 }, hi[4] = { b[3], b[4], b[5], 0 };
                rti_box_grow(&box, lo, hi);
            }
            rti_set_bounds(node, &box);
        }
    }
    for (k = 0; k < 3; k++) {
        accel->lower[k] = whole.lo[k];
        accel->upper[k] = whole.hi[k];
    }
}

/* Each order of links visits every node once, parents before their children, whose bounds lie in theirs or, spheres, hold the primitives. */
static bool rti_threaded_validate(const rt_accel *accel)
{
    size_t seen[RTI_KINDS] = { 0, 0, 0 }, i, k;
    int o;
    for (o = 0; o < accel->orders; o++) {
        const rti_link *links = accel->links + (size_t)o * accel->node_count;
        size_t visits = 0;
        uint32_t at;
        for (at = 0; at != RTI_END; at = links[at].hit, visits++) {
            const uint32_t end = at < accel->node_count ? links[at].miss : 0;
            uint32_t child;
            if (at >= accel->node_count || visits == accel->node_count) return false;
            if (accel->nodes[at].count) {
                if (links[at].hit != end) return false;
                continue;
            }
            for (child = links[at].hit, i = 0; child != end; child = links[child].miss, i++) {
                if (child >= accel->node_count || child <= at || i == RT_MAX_BRANCHING) return false;
                for (k = 0; k < 3 && accel->bounds == RT_BOUNDS_BOXES; k++)
                    if (accel->nodes[child].bounds[k] < accel->nodes[at].bounds[k] ||
                        accel->nodes[child].bounds[3 + k] > accel->nodes[at].bounds[3 + k]) return false;
            }
            if (i < 2) return false;
        }
        if (visits != accel->node_count) return false;
    }
    for (i = 0; i < accel->node_count; i++) {
        const rti_node *node = &accel->nodes[i];
        const int kind = rti_leaf_kind(node);
        if (accel->bounds == RT_BOUNDS_SPHERES ? !(node->bounds[3] >= 0) : !(node->bounds[0] <= node->bounds[3])) return false;
        if (!node->count) continue;
        if (kind >= RTI_KINDS || node->index + (size_t)rti_leaf_count(node) > accel->slots[kind]) return false;
        seen[kind] += rti_leaf_count(node);
    }
    return seen[0] == accel->slots[0] && seen[1] == accel->slots[1] && seen[2] == accel->slots[2];
}

#endif /* RTI_THREADED */

/* ---- >>build-any ---------------------------------------------------------------------------------------------------- */

static rt_status rti_check_build_options(const rt_build_options *opt)
{
    if ((unsigned)opt->structure >= RT_STRUCTURE_COUNT)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "structure %d is none of rt_structure", (int)opt->structure);
    if ((unsigned)opt->quality > RT_BUILD_HIGH)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "quality %d is none of rt_quality", (int)opt->quality);
    if (!(opt->traversal_cost >= 0 && opt->traversal_cost <= 1e6f))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "traversal_cost is %g: it must be 0 (the default) or up to 1e6",
                        (double)opt->traversal_cost);
    if (RTI_KDTREE && !(opt->empty_bonus <= 1))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "empty_bonus is %g: it must be 0 (as 0.2), up to 1, or negative (none)",
                        (double)opt->empty_bonus);
    if (RTI_KDTREE && opt->max_duplication != 0 && !(opt->max_duplication >= 1 && opt->max_duplication <= RTI_MAX_DUPLICATION))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "max_duplication is %g: it must be 0 (as %d) or between 1 and %d",
                        (double)opt->max_duplication, RTI_DUPLICATION, RTI_MAX_DUPLICATION);
    if (RTI_BVH && opt->structure == RT_BVH && opt->no_binary && opt->no_wide)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "no_binary and no_wide together leave nothing of a bvh");
    if (RTI_BVH && opt->structure == RT_BVH && opt->no_binary && !RTI_WIDES)
        return rti_fail(opt->error, RT_ERROR_UNSUPPORTED, RT_NONE, "no_binary keeps what bvh.wide reads, which is not built (RT_NO_PACKETS)");
    if (RTI_THREADED && (unsigned)opt->bounds >= RT_BOUNDS_COUNT)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "bounds %d is none of rt_bounds", (int)opt->bounds);
    if (RTI_THREADED && opt->branching && (opt->branching < 2 || opt->branching > RT_MAX_BRANCHING))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "branching is %d: it must be 0 (the default) or between 2 and %d",
                        opt->branching, RT_MAX_BRANCHING);
    if (RTI_THREADED && opt->orders && opt->orders != 1 && opt->orders != 2 && opt->orders != 4 && opt->orders != 8)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "orders is %d: it must be 0 (the default), 1, 2, 4 or 8", opt->orders);
    if (RTI_THREADED && !(opt->throw_back <= 1))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "throw_back is %g: it must be 0 (the default), up to 1, or negative (none)",
                        (double)opt->throw_back);
    if (!(opt->structure == RT_BVH ? RTI_BVH : opt->structure == RT_KDTREE ? RTI_KDTREE : RTI_THREADED))
        return rti_fail(opt->error, RT_ERROR_UNSUPPORTED, RT_NONE, "structure %s is not built (RT_NO_%s)", rti_structure_names[opt->structure],
                        opt->structure == RT_BVH ? "BVH" : opt->structure == RT_KDTREE ? "KDTREE" : "THREADED");
    return RT_OK;
}

static rt_status rti_build_tree_of(rt_accel *accel, const rt_geometry *geo, const rt_build_options *opt)
{
    rti_ref *refs = NULL;
    size_t count = 0;
    rt_status status = rti_gather_refs(accel, geo, opt, &refs, &count);
    rti_set_root(accel);
#if RTI_PLANES
    if (status == RT_OK) status = rti_build_planes(accel, geo, opt->skip_invalid, opt->error);
#endif
    if (status == RT_OK && count) {
#if RTI_KDTREE
        if (opt->structure == RT_KDTREE) status = rti_build_kdtree(accel, geo, opt, &refs, count);
#endif
#if RTI_BVH || RTI_THREADED
        if (opt->structure != RT_KDTREE) status = rti_build_bvh(accel, geo, opt, refs, count);
#endif
    }
    rti_release(refs, opt->memory_user);
#if RTI_THREADED
    if (status == RT_OK && count && opt->structure == RT_THREADED) status = rti_thread(accel, geo, opt);
#endif
#if RTI_WIDES
    if (status == RT_OK && count && opt->structure == RT_BVH && !opt->no_wide) status = rti_build_wide(accel, opt);
#endif
    if (status == RT_OK) rti_set_reach(accel);
    return status == RT_ERROR_MEMORY ? rti_fail(opt->error, status, RT_NONE, "out of memory for %lu primitives",
                                                (unsigned long)(rti_tree_count(geo) + rti_plane_count(geo)))
                                     : status;
}

static void rti_set_single(rt_accel *accel);         /* >>public */

RT_API rt_status rt_build(rt_accel **out, const rt_geometry *geo, const rt_build_options *opt)
{
    rt_build_options defaults;
    rt_accel *accel;
    rt_status status;
    if (!opt) {
        memset(&defaults, 0, sizeof defaults);
        opt = &defaults;
    }
    if (!out) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "out is NULL");
    *out = NULL;
    if ((status = rti_check_build_options(opt)) != RT_OK || (status = rti_check_geometry(geo, opt->error)) != RT_OK) return status;

    accel = (rt_accel *)rti_alloc(1, sizeof *accel, opt->memory_user);
    if (!accel) return rti_fail(opt->error, RT_ERROR_MEMORY, RT_NONE, "out of memory");
    memset(accel, 0, sizeof *accel);
    accel->structure = opt->structure;
    accel->memory_user = opt->memory_user;
    accel->bytes = sizeof *accel;
    accel->geo = *geo;
    if (!opt->reference) {
        accel->geo.vertices = NULL;
        accel->geo.indices = NULL;
#if RTI_SPHERES
        accel->geo.spheres = NULL;
#endif
    }
#if RTI_PLANES
    accel->geo.planes = NULL;               /* always copied */
#endif
#if RTI_INSTANCES
    accel->geo.instances = NULL;            /* likewise */
#endif
    status = rti_number_instances(accel, geo, opt->structure == RT_BVH && opt->no_binary, opt->error);
    if (status == RT_OK) status = rti_build_tree_of(accel, geo, opt);
    if (status != RT_OK) {
        rti_free_accel(accel);
        return status;
    }
    rti_set_single(accel);
    *out = accel;
    return RT_OK;
}

RT_API void rt_free(rt_accel *accel)
{
    if (accel) rti_free_accel(accel);
}

/* ---- >>refit -------------------------------------------------------------------------------------------------------- */

#if RTI_WIDES
/* After the primitives have moved. */
static void rti_refit_wide(rt_accel *accel, const rt_geometry *geo)
{
    size_t w, b;
    int i, k;
    for (b = 0; accel->octets && b < accel->octet_count; b++) {
        rti_octet *octet = &accel->octets[b];
        for (i = 0; i < RTI_CHILDREN; i++) {
            float v[9];
            (void)rti_fetch_triangle(geo, octet->prim[i], v);
            for (k = 0; k < 9; k++) octet->v[k][i] = v[k];
        }
    }
    for (w = accel->wide_count; w-- > 0;) {             /* children stand behind their parents */
        rti_wide *wide = &accel->wides[w];
        for (i = 0; i < RTI_CHILDREN; i++) {
            rti_box box;
            rti_node leaf;
            leaf.index = wide->index[i];
            leaf.count = wide->count[i];
            if (leaf.count == RTI_NO_CHILD) continue;
            if (!leaf.count) box = rti_wide_bounds(&accel->wides[leaf.index]);
            else if (accel->octets && rti_leaf_kind(&leaf) == RTI_TRIANGLE) box = rti_octet_bounds(&accel->octets[leaf.index]);
            else box = rti_leaf_box(accel, geo, &leaf);
            for (k = 0; k < 3; k++) {
                wide->bounds[k][i] = box.lo[k];
                wide->bounds[3 + k][i] = box.hi[k];
            }
        }
    }
}
#endif

RT_API rt_status rt_refit_error(rt_accel *accel, const rt_geometry *geo, rt_error *error)
{
    size_t i, bad = SIZE_MAX;
    int kind, k;
    rt_status status;
    if (!accel) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "accel is NULL");
    if ((status = rti_check_geometry(geo, error)) != RT_OK) return status;
    if (accel->structure == RT_KDTREE)
        return rti_fail(error, RT_ERROR_UNSUPPORTED, RT_NONE, "a %s cannot be refitted: its planes cut primitives where they were; build "
                        "a new one", rti_structure_names[accel->structure]);
    if (geo->triangle_count != accel->geo.triangle_count || rti_sphere_count(geo) != rti_sphere_count(&accel->geo) ||
        rti_instance_count(geo) != rti_instance_count(&accel->geo) || rti_plane_count(geo) != rti_plane_count(&accel->geo))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "the counts differ from those accel was built from: build a new one");

    for (kind = 0; kind < RTI_KINDS; kind++)            /* look at everything before anything changes */
        for (i = 0; i < rti_slot_count(accel, kind); i++) {
            uint32_t prim = rti_slot_prim(accel, kind, i);
            rti_box box;
            int prim_kind;
            if (prim < bad && rti_prim_box(geo, prim, &box, &prim_kind)) bad = prim;
        }
#if RTI_PLANES
    for (i = 0; i < accel->plane_count; i++) {
        rti_box box;
        int prim_kind;
        if (accel->planes[i].prim < bad && rti_prim_box(geo, accel->planes[i].prim, &box, &prim_kind)) bad = accel->planes[i].prim;
    }
#endif
    if (bad != SIZE_MAX) return rti_bad_prim(error, geo, bad);
#if RTI_INSTANCES
    for (i = 0; i < accel->slots[RTI_INSTANCE]; i++) {
        const rti_instance *in = &accel->instances[i];
        size_t number = in->prim - geo->triangle_count - rti_sphere_count(geo);
        const rt_accel *child = geo->instances[number].accel;
        uint32_t paths = (number + 1 < geo->instance_count ? accel->instance_bases[number + 1] : accel->paths) - in->base - 1;
        if (rti_is_empty(child) || child->paths != paths || child->nesting + 1 > RT_MAX_NESTING)        /* what holds accel has more paths */
            return rti_fail(error, RT_ERROR_ARGUMENT, in->prim,
                            "instance %lu now shows an accel that is empty, nests otherwise or holds the one it is in: build a new one",
                            (unsigned long)number);
        if (rti_only_wide(child) && !rti_only_wide(accel))
            return rti_fail(error, RT_ERROR_ARGUMENT, in->prim, "instance %lu now shows an accel built with no_binary, and what holds it "
                            "was not: build it anew", (unsigned long)number);
    }
#endif
    if (accel->triangles)
        for (i = 0; i < accel->slots[RTI_TRIANGLE]; i++) rti_fill_triangle(&accel->triangles[i], geo);
    else if (accel->triangle_ids) {
        accel->geo.vertices = geo->vertices;
        accel->geo.indices = geo->indices;
    }
    accel->geo.vertex_count = geo->vertex_count;
    accel->geo.vertex_stride = geo->vertex_stride;
#if RTI_SPHERES
    if (accel->balls)
        for (i = 0; i < accel->slots[RTI_SPHERE]; i++) rti_fill_ball(&accel->balls[i], geo);
    else if (accel->ball_ids) accel->geo.spheres = geo->spheres;
#endif
#if RTI_INSTANCES
    for (i = 0; i < accel->slots[RTI_INSTANCE]; i++) rti_fill_instance(&accel->instances[i], geo);
#endif
#if RTI_PLANES
    for (i = 0, accel->endless = false; i < accel->plane_count; i++) {
        rti_ground *plane = &accel->planes[i];
        rti_fill_plane(plane, geo);
        if (!(plane->radius > 0)) accel->endless = true;
    }
#endif
#if RTI_THREADED
    if (accel->structure == RT_THREADED) {
        rti_rebound(accel, geo);
        rti_set_reach(accel);
        return RT_OK;
    }
#endif
    for (i = accel->nodes ? accel->node_count : 0; i-- > 0;) {              /* children stand behind their parents */
        rti_node *node = &accel->nodes[i];
        rti_box box;
        if (node->count) box = rti_leaf_box(accel, geo, node);
        else
            for (k = 0; k < 3; k++) {
                const rti_node *a = &accel->nodes[node->index], *b = a + 1;
                box.lo[k] = a->bounds[k] < b->bounds[k] ? a->bounds[k] : b->bounds[k];
                box.hi[k] = a->bounds[3 + k] > b->bounds[3 + k] ? a->bounds[3 + k] : b->bounds[3 + k];
            }
        rti_set_bounds(node, &box);
    }
#if RTI_WIDES
    if (accel->wides) rti_refit_wide(accel, geo);
#endif
    rti_set_root(accel);
    rti_set_reach(accel);
    return RT_OK;
}

RT_API rt_status rt_refit(rt_accel *accel, const rt_geometry *geo) { return rt_refit_error(accel, geo, NULL); }

/* ---- >>info --------------------------------------------------------------------------------------------------------- */

#if RTI_KDTREE
static void rti_kd_info(const rt_accel *accel, rt_info *info)
{
    struct { uint32_t node; rti_box box; } stack[RTI_MAX_DEPTH + 1];
    double area;
    int top = 0;
    if (!accel->node_count) return;
    info->nodes--;                          /* node 1 is none */
    memset(&stack[0], 0, sizeof stack[0]);
    memcpy(stack[0].box.lo, accel->lower, sizeof accel->lower);
    memcpy(stack[0].box.hi, accel->upper, sizeof accel->upper);
    area = rti_half_area(&stack[0].box);
    for (top = 1; top;) {
        const rti_kdnode *node = &accel->kdnodes[stack[--top].node];
        const int axis = (int)(node->word & 3);
        const double part = area > 0 ? rti_half_area(&stack[top].box) / area : 1;
        if (axis == (int)RTI_LEAF) {
            const uint32_t count = node->as.count & RTI_COUNT_MASK;
            info->leaves++;
            info->empty_leaves += !count;
            info->sah += part * (double)count;
            if (count > info->max_leaf) info->max_leaf = count;
            continue;
        }
        info->sah += part;
        stack[top + 1] = stack[top];
        stack[top].node = rti_kd_children(node);
        stack[top++].box.hi[axis] = node->as.split;
        stack[top].node = rti_kd_children(node) + 1;
        stack[top++].box.lo[axis] = node->as.split;
    }
}
#endif

#if RTI_BVH || RTI_THREADED
static void rti_bvh_info(const rt_accel *accel, rt_info *info)
{
    double area = 0;
    size_t i;
    for (i = 0; i < accel->node_count; i++) {
        const rti_node *node = &accel->nodes[i];
        double part = rti_node_area(node);
#if RTI_THREADED
        if (accel->structure == RT_THREADED) part = rti_surface(accel, node);
#endif
        if (!i) area = part;
        part = area > 0 ? part / area : 1;
#if RTI_THREADED
        if (accel->structure == RT_THREADED && !node->count) {      /* a test a child, where RT_BVH has two a node */
            uint32_t child;
            for (child = accel->links[i].hit; child != accel->links[i].miss; child = accel->links[child].miss)
                info->sah += part * 0.5 * RTI_TRAVERSAL_COST;
            continue;
        }
#endif
        if (node->count) {
            uint32_t count = rti_leaf_count(node);
            info->leaves++;
            info->sah += part * (double)count;
            if (count > info->max_leaf) info->max_leaf = count;
        } else info->sah += part * RTI_TRAVERSAL_COST;
    }
}
#endif

#if RTI_WIDES
static void rti_wide_info(const rt_accel *accel, rt_info *info)
{
    const rti_box root = rti_wide_bounds(&accel->wides[0]);
    const double area = rti_half_area(&root), unit = area > 0 ? 1 / area : 0;
    size_t w;
    int i, k;
    for (w = 0; w < accel->wide_count; w++) {
        const rti_wide *wide = &accel->wides[w];
        rti_box box = rti_wide_bounds(wide);
        info->sah += (area > 0 ? rti_half_area(&box) * unit : 1) * RTI_TRAVERSAL_COST;
        for (i = 0; i < RTI_CHILDREN; i++) {
            const uint32_t count = wide->count[i] & RTI_COUNT_MASK;
            if (!count) continue;           /* a wide node, or none */
            for (k = 0; k < 3; k++) {
                box.lo[k] = wide->bounds[k][i];
                box.hi[k] = wide->bounds[3 + k][i];
            }
            info->leaves++;
            info->sah += (area > 0 ? rti_half_area(&box) * unit : 1) * (double)count;
            if (count > info->max_leaf) info->max_leaf = count;
        }
    }
    info->nodes += info->leaves;
}
#endif

RT_API void rt_get_info(const rt_accel *accel, rt_info *info)
{
    int i;
    memset(info, 0, sizeof *info);
    info->structure = accel->structure;
    info->triangles = accel->geo.triangle_count;
    info->spheres = rti_sphere_count(&accel->geo);
    info->instances = rti_instance_count(&accel->geo);
    info->planes = rti_plane_count(&accel->geo);
    info->skipped = accel->skipped;
    info->nodes = accel->node_count;
    info->depth = accel->depth;
    info->nesting = accel->nesting;
    info->bytes = accel->bytes;
    info->lower.x = accel->outer_lower[0];
    info->lower.y = accel->outer_lower[1];
    info->lower.z = accel->outer_lower[2];
    info->upper.x = accel->outer_upper[0];
    info->upper.y = accel->outer_upper[1];
    info->upper.z = accel->outer_upper[2];
    for (i = 0; i < RTI_KINDS; i++) info->references += accel->slots[i];
#if RTI_KDTREE
    if (accel->structure == RT_KDTREE) {
        info->references = accel->references;
        rti_kd_info(accel, info);
    }
#endif
#if RTI_BVH || RTI_THREADED
    if (accel->nodes) rti_bvh_info(accel, info);
#endif
#if RTI_WIDES
    if (rti_only_wide(accel)) rti_wide_info(accel, info);
#endif
}

#endif
#if RTI_IN(SHADING) && RTI_INSTANCES
/* The instances of an accel: what it takes to follow a path through them. */
RTI_SHARED(
typedef struct {
    const RTI_GLOBAL uint32_t *bases, *slots;
    const RTI_GLOBAL rti_instance *instances;
    uint32_t count, paths;
} rti_family;
)
#endif
#if RTI_IN(HOST) && RTI_INSTANCES
static rti_family rti_family_of(const rt_accel *accel)
{
    rti_family family;
    family.bases = accel->instance_bases;
    family.slots = accel->instance_slots;
    family.instances = accel->instances;
    family.count = (uint32_t)accel->geo.instance_count;
    family.paths = accel->paths;
    return family;
}
#endif
#if RTI_IN(SHADING) && RTI_INSTANCES
/* The number of the instance that the path inst (< paths) goes through: the last whose base is not above it. */
RTI_SHARED(
static uint32_t rti_find_instance(const rti_family *family, uint32_t inst)
{
    uint32_t lo = 0, hi = family->count;
    while (hi - lo > 1) {
        const uint32_t mid = lo + (hi - lo) / 2;
        if (family->bases[mid] <= inst) lo = mid;
        else hi = mid;
    }
    return lo;
}
)

/* Moves what a transform places to where it is at a time. */
RTI_SHARED(
static void rti_move(const rt_motion *motion, double time, double m[12])
{
    const double move[3] = { (double)motion->move.x, (double)motion->move.y, (double)motion->move.z };
    const double pivot[3] = { (double)motion->pivot.x, (double)motion->pivot.y, (double)motion->pivot.z };
    double r[9], column[3];
    int i, j;
    rti_turn(motion, time, r);
    for (i = 0; i < 3; i++) m[4 * i + 3] -= pivot[i];
    for (j = 0; j < 4; j++) {
        for (i = 0; i < 3; i++) column[i] = m[4 * i + j];
        for (i = 0; i < 3; i++) {
            m[4 * i + j] = rti_round(r[3 * i] * column[0]) + rti_round(r[3 * i + 1] * column[1]) + rti_round(r[3 * i + 2] * column[2]);
            if (j == 3) m[4 * i + j] += pivot[i] + rti_round(move[i] * time);
        }
    }
}
)

/* One level down a path, on which RT_NONE is the end: multiplies m by the transform of that instance, whose number is answered, at a time.
   RT_NONE: no such instance. */
RTI_SHARED(
static uint32_t rti_descend(const rt_accel *root, rti_family *family, uint32_t *inst, float time, double m[12])
{
    uint32_t number, slot;
    (void)root;
    if (*inst >= family->paths) return RT_NONE;
    number = rti_find_instance(family, *inst);
    slot = family->slots[number];
    if (slot == RT_NONE) return RT_NONE;
    {
        const rti_instance in = family->instances[slot];
        double n[12], row[3];
        int i, j;
        RTI_OPEN(child, root, in.accel);
        for (i = 0; i < 12; i++) n[i] = (double)in.transform[i];
        if (in.moves) rti_move(&in.motion, (double)rti_clamp_time(time), n);
        for (i = 0; i < 3; i++) {
            for (j = 0; j < 3; j++) row[j] = m[4 * i + j];
            for (j = 0; j < 4; j++) {
                const double sum = rti_round(row[0] * n[j]) + rti_round(row[1] * n[4 + j]) + rti_round(row[2] * n[8 + j]);
                m[4 * i + j] = j == 3 ? sum + m[4 * i + 3] : sum;
            }
        }
        *inst = *inst - in.base - 1;
        *family = rti_family_of(child);
    }
    return number;
}
)
#endif
#if RTI_IN(HOST)

#if RTI_INSTANCES
RT_API bool rt_instance_transform(const rt_accel *accel, uint32_t inst, float transform[12], float normal[9])
{
    return rt_instance_transform_at(accel, inst, 0, transform, normal);
}

RT_API bool rt_instance_transform_at(const rt_accel *accel, uint32_t inst, float time, float transform[12], float normal[9])
{
    double m[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    rti_family family = rti_family_of(accel);
    float f[12], inverse[12];
    int i, j;
    while (inst != RT_NONE)
        if (rti_descend(accel, &family, &inst, time, m) == RT_NONE) return false;
    for (i = 0; i < 12; i++) f[i] = (float)m[i];
    if (transform) memcpy(transform, f, sizeof f);
    if (normal) {
        if (!rti_invert(f, inverse)) return false;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) normal[3 * i + j] = inverse[4 * j + i];
    }
    return true;
}
#endif

/* ---- >>ray ---------------------------------------------------------------------------------------------------------- */

/* What a traversal does, as constants that the compiler folds into one body a combination. */
#define RTI_WALK_ANY   1                    /* stop at the first hit */
#define RTI_WALK_ALL   2                    /* leaves may hold spheres and instances */
#define RTI_WALK_COUNT 4                    /* fill rt_stats */
#define RTI_WALK_ROUND 16                   /* RT_THREADED: bounds are spheres; */
#define RTI_WALK_EITHER 32                  /* what they are is asked each time */
#define RTI_WALK_LIKELY 8                   /* a triangle that is tested is likely to be hit */

#if !RTI_STATS
typedef struct { uint64_t unused; } rt_stats;
#endif
#if RTI_STATS
#define RTI_TALLY(stats, flags, field, n) do { if ((flags) & RTI_WALK_COUNT) (stats)->field += (uint64_t)(n); } while (0)
#define RTI_COUNTS(job) ((job)->stats != NULL)
#else
#define RTI_TALLY(stats, flags, field, n) ((void)0)
#define RTI_COUNTS(job) false
#endif

/* What RT_AUTO learns, see rti_batch_auto: ticks of a ray, by each way to trace a BVH, over those of the first way; 0: not tried. */
enum { RTI_BY_CROWDS, RTI_BY_SIMD, RTI_BY_RANGED, RTI_WAYS };
typedef struct {
    float cost[RTI_WAYS], ticks;            /* ticks: of the first way, in the last trial */
    int next;                               /* the way that is tried next, */
    unsigned trials, rest;                  /* and after how many packets */
} rti_tuner;

/* One call of rt_trace, resolved. */
struct rti_job {
    rt_query query;
    rt_stats *stats;                        /* NULL: nothing is counted */
    rt_algorithm algorithm;                 /* of RT_KDTREE: how its trees are walked */
    int entries;                            /* of the short stack */
    rt_algorithm large;                     /* of large packets: how BVHs are walked, */
    int side;                               /* rays a side, */
    rt_cull cull;                           /* and by what they are culled */
    const float *times;                     /* one a ray, or NULL */
    bool wide;                              /* RT_BVH_WIDE, where an accel has wide nodes: single rays, or packets with side > 1 */
    bool single;                            /* of rt_accel.single_jobs: rti_batch may take single_walks */
    rti_tuner *tuner;                       /* of RT_AUTO: what is known of rays like these; NULL: nothing yet */
    const rt_ray_arrays *from;              /* rt_trace_arrays: in the place of rays and hits */
    const rt_hit_arrays *to;
};

static const rti_job rti_plain_jobs[] = {    /* by query: nothing but the hits of SIMD rays, or of single ones */
    { RT_CLOSEST, NULL, RT_KD_STACK, 0, RT_AUTO, 1, RT_CULL_NONE, NULL, false, true, NULL, NULL, NULL },
    { RT_ANY,     NULL, RT_KD_STACK, 0, RT_AUTO, 1, RT_CULL_NONE, NULL, false, true, NULL, NULL, NULL },
};
static const rti_job rti_wide_jobs[] = {     /* the same by RT_BVH_WIDE */
    { RT_CLOSEST, NULL, RT_KD_STACK, 0, RT_AUTO, 1, RT_CULL_NONE, NULL, true, true, NULL, NULL, NULL },
    { RT_ANY,     NULL, RT_KD_STACK, 0, RT_AUTO, 1, RT_CULL_NONE, NULL, true, true, NULL, NULL, NULL },
};

/* Pixels of a SIMD ray from left to right, by how many rays are side by side. */
#define RTI_PACKET_COLUMNS(lanes) ((lanes) == 8 ? 4 : (lanes) == 4 ? 2 : 1)

#define RTI_AUTO_RAYS 256u                  /* of a packet of RT_AUTO: 16 x 16 */
#define RTI_TRIALS 256                      /* packets from one trial of RT_AUTO to the next; less at first, see rti_learn */

#if RTI_WIDES
/* A clock that costs nothing to read, in units of its own; 0: there is none. */
RTI_INLINE uint64_t rti_ticks(void)
{
#if RTI_X86
    return __rdtsc();
#elif defined(__aarch64__) && defined(__GNUC__)
    uint64_t ticks;
    __asm__ volatile("mrs %0, cntvct_el0" : "=r"(ticks));
    return ticks;
#else
    return 0;
#endif
}

/* A trial of what is next has taken ticks a ray. The ways are tried on packets that follow each other, which are alike, so ratios are what
   counts: means at first, which then fade slowly. All ways find cold caches in the first round, which is forgotten. wide: crowds can be had.
   Ranged, which is slow for rays that part, is tried where SIMD rays are not much slower than crowds. */
static void rti_learn(rti_tuner *tuner, bool wide, float ticks)
{
    const int first = wide ? RTI_BY_CROWDS : RTI_BY_SIMD, way = tuner->next++;
    const float weight = tuner->trials < 8 ? 1 / (float)(tuner->trials + 1) : 0.125f;
    if (way == first) tuner->ticks = ticks > 0 ? ticks : 1;
    ticks = ticks < 4 * tuner->ticks ? ticks / tuner->ticks : 4;
    if (!(tuner->cost[way] > 0)) tuner->cost[way] = 1;     /* or few rays that happen to suit it would decide */
    tuner->cost[way] += weight * (ticks - tuner->cost[way]);
    if (way == RTI_BY_CROWDS || (way == RTI_BY_SIMD && (!wide || tuner->cost[RTI_BY_SIMD] < 1.3f))) return;
    if (!tuner->trials++) memset(tuner->cost, 0, sizeof tuner->cost);
    tuner->next = first;
    tuner->rest = tuner->trials < 4 ? RTI_TRIALS / 16 : tuner->trials < 7 ? RTI_TRIALS / 4 : RTI_TRIALS;
}

/* Crowds, unless others are faster by more than chance. */
RTI_INLINE int rti_fastest_way(const rti_tuner *tuner, bool wide)
{
    const float simd = tuner->cost[RTI_BY_SIMD], ranged = tuner->cost[RTI_BY_RANGED], crowds = 0.85f * tuner->cost[RTI_BY_CROWDS];
    const int other = simd > 0 && !(ranged > 0 && ranged < simd) ? RTI_BY_SIMD : RTI_BY_RANGED;
    return wide && !(tuner->cost[other] > 0 && tuner->cost[other] < crowds) ? RTI_BY_CROWDS : other;
}
#endif

/* The i-th primitive of a leaf: i itself, or what slots says; see rti_kdnode. */
#endif
#if RTI_IN(BASE)
RTI_SHARED(
RTI_INLINE uint32_t rti_slot(const RTI_GLOBAL uint32_t *slots, uint32_t i) { return slots ? slots[i] & RTI_COUNT_MASK : i; }
)
#endif
#if RTI_IN(HOST)

/* The vertices of the triangle in a slot, and its primitive; gathered: room for them. */
RTI_INLINE const float *rti_corners(const rt_accel *accel, uint32_t slot, float gathered[9], uint32_t *prim)
{
    if (accel->triangles) {
        *prim = accel->triangles[slot].prim;
        return accel->triangles[slot].v;
    }
    *prim = accel->triangle_ids[slot];
    (void)rti_fetch_triangle(&accel->geo, *prim, gathered);
    return gathered;
}

#if RTI_SPHERES
RTI_INLINE rti_ball rti_ball_at(const rt_accel *accel, uint32_t slot)
{
    rti_ball ball;
    if (accel->balls) return accel->balls[slot];
    ball.prim = accel->ball_ids[slot];
    rti_fill_ball(&ball, &accel->geo);
    return ball;
}
#endif

RTI_INLINE int rti_bit_count(unsigned bits)
{
    int n = 0;
    for (; bits; bits &= bits - 1) n++;
    return n;
}
#if RTI_KDTREE
RTI_INLINE int rti_highest_bit(uint64_t bits)           /* of at least one */
{
#if defined(__GNUC__) || defined(__clang__)
    return 63 - __builtin_clzll(bits);
#else
    int n = 0;
    while (bits >>= 1) n++;
    return n;
#endif
}
#endif
RTI_INLINE int rti_lowest_bit(unsigned bits)            /* of at least one */
{
#if defined(__GNUC__) || defined(__clang__)
    return __builtin_ctz(bits);
#else
    int n = 0;
    while (!(bits >> n & 1)) n++;
    return n;
#endif
}

RTI_INLINE void rti_set_miss(rt_hit *hit)
{
    hit->t = RTI_INFINITY;
    hit->u = hit->v = 0;
    hit->prim = hit->inst = RT_NONE;
}

/* ---- >>frustum ------------------------------------------------------------------------------------------------------ */

#define RTI_STEEP 64.0f

#endif
#if RTI_IN(FRUSTUM)

/* Around all rays of a large packet ([Overbeck] 4), from what bounds them.

   Along the axis k, which all rays follow in the same direction, s = sign * (x[k] - start) runs from 0 to length, and on every ray
   x[u], -x[u], x[v] and -x[v] are at least bound + slope * s: four side planes. They follow from where the rays cross two planes of constant
   k, near and far ([Overbeck] 4.3), or, where all rays pass through one point, the apex, from their slopes alone (4.1, and 4.2 with the
   light as the apex: s then runs from the light to the surface).
   What culling must not lose is what the primitive test may find: that lies within pad of the exact ray (see rti_prepare), whose
   largest in the packet, and what the floats of the frustum itself may lose, make the frustum's pad.
   No frustum: where signs along k are mixed, rays are steeper than RTI_STEEP, begin before their origin (tmin < 0) or are far out. */
RTI_SHARED(
typedef struct {
    float org_low[3], org_high[3], end_low[3], end_high[3];     /* of all rays; end: org + dir, not looked at where all orgs are one */
    float way[3];                           /* where they go: the sum of all dirs, or the middle of their range */
    float tmin, tmax, pad;
    unsigned sides[3];                      /* bit 0: some ray goes up that axis, bit 1: some goes down */
} rti_bundle;

typedef struct {
    int k, u, v;
    int near_k, far_k;                      /* which of a box's bounds rays meet first and last along k */
    float sign, start, length, pad;
    float bound[4], slope[4];
    float outside[4], rslope[4];            /* bound - pad; the inverse of slope */
    float beyond[4];                        /* infinity with the sign that slope does not have */
    float apex[3], sway;                    /* rays pass the apex within sway; negative: there is none */
    float low[2], high[2], steep;           /* of the slopes along u and v; steep: the largest, sign aside */
    float reach;                            /* the largest coordinates that come up */
    bool to_point;                          /* the apex is where rays end, t = 1 */
} rti_frustum;
)

/* Apex and axis; pad is that of the rays, and of the apex. False: there is no frustum. */
RTI_SHARED(
RTI_INLINE bool rti_aim_frustum(const rt_accel *accel, const rti_bundle *b, rti_frustum *f)
{
    bool from_point = true, to_point = b->tmax <= 1;
    int k;
    f->reach = 0;
    for (k = 0; k < 3; k++) {
        const float most = rti_maxf(fabsf(b->org_low[k]), fabsf(b->org_high[k]));
        from_point = from_point && b->org_low[k] == b->org_high[k];
        f->reach = rti_maxf(f->reach, most + rti_maxf(fabsf(accel->lower[k]), fabsf(accel->upper[k])));
        to_point = to_point && b->end_high[k] - b->end_low[k] <= 4.8e-7f * (most + fabsf(b->end_low[k]) + fabsf(b->end_high[k]));
    }
    f->to_point = to_point && !from_point;
    f->sway = from_point || to_point ? 0.0f : -1.0f;
    for (k = 0; k < 3; k++) {
        f->apex[k] = from_point ? b->org_low[k] : b->end_low[k] + (b->end_high[k] - b->end_low[k]) * 0.5f;
        if (f->to_point) f->sway = rti_maxf(f->sway, b->end_high[k] - b->end_low[k] + 4.8e-7f * (f->reach + fabsf(f->apex[k])));
    }
    f->pad = b->pad + rti_maxf(f->sway, 0) + 2.4e-7f * f->reach;

    f->k = fabsf(b->way[0]) > fabsf(b->way[1]) ? 0 : 1;
    if (fabsf(b->way[2]) > fabsf(b->way[f->k])) f->k = 2;
    f->u = f->k == 2 ? 0 : f->k + 1;
    f->v = f->u == 2 ? 0 : f->u + 1;
    f->sign = b->way[f->k] < 0 ? -1.0f : 1.0f;
    return f->reach <= 1e15f && b->tmin >= 0 && fabsf(b->way[f->k]) < 1e35f && b->sides[f->k] != 3;
}
)

/* From the slopes: where s begins and ends, and with an apex the side planes, which else rti_set_sides tells. shortest: the least |dir| along
   k. False: there is no frustum, all being behind the rays, or far out: boxes tell. */
RTI_SHARED(
RTI_INLINE bool rti_span_frustum(const rt_accel *accel, const rti_bundle *b, rti_frustum *f, float shortest)
{
    int a;
    f->steep = 0;
    for (a = 0; a < 2; a++) f->steep = rti_maxf(f->steep, rti_maxf(fabsf(f->low[a]), fabsf(f->high[a])));
    if (!(shortest >= 1e-20f) || !(f->steep <= RTI_STEEP)) return false;
    if (f->sway >= 0) {
        if (f->to_point) f->sign = -f->sign;    /* from where the rays end to where they start */
        f->start = f->apex[f->k];
        if (f->to_point) f->length = f->sign * ((f->sign > 0 ? b->org_high[f->k] : b->org_low[f->k]) - f->start);
        else f->length = f->sign * ((f->sign > 0 ? accel->upper[f->k] : accel->lower[f->k]) - f->start);
        for (a = 0; a < 2; a++) {
            f->bound[2 * a] = f->apex[a ? f->v : f->u];
            f->bound[2 * a + 1] = -f->bound[2 * a];
            f->slope[2 * a] = f->sign > 0 ? f->low[a] : -f->high[a];
            f->slope[2 * a + 1] = f->sign > 0 ? -f->high[a] : f->low[a];
        }
    } else {
        const float scene = f->sign > 0 ? accel->upper[f->k] : accel->lower[f->k], end = f->sign > 0 ? b->end_high[f->k] : b->end_low[f->k];
        f->start = f->sign > 0 ? b->org_low[f->k] : b->org_high[f->k];
        f->length = f->sign * ((b->tmax <= 1 && f->sign * (end - scene) < 0 ? end : scene) - f->start);
    }
    f->reach += fabsf(f->length);
    f->length += 2e-6f * (1 + f->steep) * f->reach;
    return f->length > 0 && f->reach <= 1e15f;
}
)

/* Side planes of axis a (0: u, 1: v), from the bounds of where all rays cross s = 0 and s = length: [Overbeck] 4.3. */
RTI_SHARED(
RTI_INLINE void rti_set_sides(rti_frustum *f, int a, float near_low, float near_high, float far_low, float far_high)
{
    f->bound[2 * a] = near_low;
    f->bound[2 * a + 1] = -near_high;
    f->slope[2 * a] = (far_low - near_low) / f->length;
    f->slope[2 * a + 1] = -(far_high - near_high) / f->length;
}

RTI_INLINE void rti_close_frustum(rti_frustum *f)
{
    int i;
    f->pad = (f->pad + 2e-6f * (1 + f->steep) * f->reach) * (1 + f->steep);
    for (i = 0; i < 4; i++) {
        const float slope = f->slope[i];
        f->outside[i] = f->bound[i] - f->pad;
        f->rslope[i] = 1 / (fabsf(slope) > 1e-7f ? slope : slope < 0 ? -1e-7f : 1e-7f);
        f->beyond[i] = slope < 0 ? RTI_INFINITY : -RTI_INFINITY;
    }
    f->near_k = f->sign > 0 ? f->k : f->k + 3;
    f->far_k = f->sign > 0 ? f->k + 3 : f->k;
}
)

#endif
#if RTI_IN(HOST)

/* ---- >>tiles -------------------------------------------------------------------------------------------------------- */

/* What >>raster makes and the kernels of >>cover read. */

#define RTI_BLOCK 16                        /* pixels: a block of 16 x 16 rays is traced in one call */
#define RTI_BLOCK_RAYS (RTI_BLOCK * RTI_BLOCK)
#define RTI_MAX_SIDE (1 << 20)              /* floats still tell 16 places in a pixel apart */

#endif
#if RTI_IN(SHADING) && !defined(RT_NO_SHADING)
/* right and down are a pixel's steps, corner the direction of the picture's top left corner, at depth 1. */
RTI_SHARED(
typedef struct { rt_vec3 eye, corner, right, down; } rti_view;
)
#endif
#if RTI_IN(HOST)
#ifndef RT_NO_SHADING

/* The way back: for a point p, rows * (p - eye) = depth * (x, y, 1), where the ray through (x, y) meets it at t = depth. Homogeneous: what
   is linear in p - eye is so before the division, for points behind the eye too. See rti_make_lens for what is known of the errors. */
typedef struct {
    double eye[3], rows[3][3];
    double sums[3];                         /* of a row's absolute values: the most it makes of a vector with components within 1 */
    double sway[2];                         /* pixels: how far the direction of a ray, rounded, may point beside its sample */
    double stretch;                         /* how far the depth of such a direction may be from 1 */
    double tiny;                            /* a distance that no underflow moves a hit by more than 2^-19 of */
    float edge[2];                          /* the picture's width and height */
    bool blind;                             /* rounding is all there is to see: no row can be trusted */
    bool narrow;                            /* floats do where doubles are used otherwise: nothing can overflow */
} rti_lens;

/* A primitive in the picture: rays through a sample beside lo..hi miss it, and no hit on it has a t below depth. lo > hi: unseen. */
typedef struct { float lo[2], hi[2], depth; } rti_span;

/* Tiles of 2^shift pixels a side, row by row: tile i holds entries[starts[first + i]] to entries[starts[first + i + 1]]. */
typedef struct { int shift, columns; uint32_t first; } rti_level;
#define RTI_MAX_LEVELS 17                   /* 16 pixels to RTI_MAX_SIDE */

/* A block of pixels to cover: at most RTI_BLOCK a side, within one tile of the finest level. */
typedef struct {
    int box[4];                             /* x0, y0, x1, y1 */
    float x, y;                             /* of its first sample */
    const rt_ray *rays;                     /* packet by packet */
    rt_hit *hits;                           /* of the pixel (x0, y0) */
    size_t stride;                          /* hits from a row to the next */
} rti_block;

typedef void (*rti_see_function)(const rt_raster *r, size_t first, size_t count);
typedef void (*rti_cover_function)(const rt_raster *r, const rti_block *block);

struct rt_raster {
    rt_accel accel;                         /* no tree: geo, and instances by their number */
    rt_camera camera;
    rti_view view;
    rti_lens lens;
    int width, height;
    rti_see_function see;
    rti_cover_function cover;
    int lanes;                              /* triangles of see, rays of a packet of cover */
    rti_span *spans;                        /* one a primitive */
    uint32_t *starts, *entries;
    rti_level levels[RTI_MAX_LEVELS];       /* the finest first; the last is one tile */
    int level_count;
    rt_raster_info info;
};

/* Pixels of a packet, see RTI_PACKET_COLUMNS, and of the square of them that is covered at once, by how many rays are side by side. */
#define RTI_PACKET_ROWS(lanes) ((lanes) == 1 ? 1 : 2)
#define RTI_COVER_SIDE(lanes) ((lanes) == 1 ? 8 : RTI_BLOCK)

RTI_INLINE void rti_project(const rti_lens *lens, const double p[3], double h[3])
{
    int k;
    for (k = 0; k < 3; k++) h[k] = lens->rows[k][0] * p[0] + lens->rows[k][1] * p[1] + lens->rows[k][2] * p[2];
}

/* How far rounding may move a hit on a primitive whose farthest coordinate is that far from the eye, see rti_make_lens. */
RTI_INLINE double rti_drift(const rti_lens *lens, double reach) { return (reach + lens->tiny) * 1.9073486328125e-06; }

#endif

/* ---- >>surfaces ----------------------------------------------------------------------------------------------------- */

#endif
#if RTI_IN(SHADING) && !defined(RT_NO_SHADING)
/* What >>render gathers from the hits of a batch and the kernels of >>shade work on: numbers of 8 surfaces side by side. */
RTI_SHARED(
typedef enum {
    RTI_POINT     = 0,                      /* x, y, z: where the ray ends; then where secondary rays start, in front of the surface */
    RTI_VIEW      = 3,                      /* the ray's dir; then of unit length, towards where it came from */
    RTI_GEOMETRIC = 6,                      /* the surface's normal; then of unit length, on the viewer's side */
    RTI_NORMAL    = 9,                      /* the shading normal; then of unit length, on the side of the other */
    RTI_OFFSET    = 12,                     /* how large the numbers are that t was made of; then how far in front of the surface
                                               secondary rays start */
    RTI_TO_LIGHT  = 13,                     /* from there to the light */
    RTI_COSINE    = 16,                     /* of the shading normal and the light; 0 where that lies behind the surface */
    RTI_HIGHLIGHT = 17,                     /* of the mirrored light and the viewer */
    RTI_LANE_COUNT = 18
} rti_lane;
)
#endif
#if RTI_IN(HOST)

#ifndef RT_NO_SHADING
#define RTI_ABREAST 8

typedef struct { float lanes[RTI_LANE_COUNT * RTI_ABREAST]; } RTI_ALIGNED(32) rti_surfaces;     /* number k of surface i at 8 k + i */

/* count surfaces; what is behind them in their last rti_surfaces is read and written too. light NULL: each surface has its own, in
   RTI_TO_LIGHT. */
typedef void (*rti_finish_function)(rti_surfaces *s, size_t count);
typedef void (*rti_aim_function)(rti_surfaces *s, size_t count, const rt_vec3 *light);

#endif

/* ---- >>passes ------------------------------------------------------------------------------------------------------- */

#define RTI_SEEN 16                         /* instances that a walk through a k-d tree remembers: nested ones would take ever longer */

#define RTI_PASTE2(a, b) a##b
#define RTI_PASTE(a, b) RTI_PASTE2(a, b)

/* This file again, once a width and instruction set. */
#define RTI_PASS
#define RTI_LANES_FLOAT 1
#define RTI_LANES_ARRAY 2
#define RTI_LANES_SSE2  3
#define RTI_LANES_AVX2  4

#define RTI_WIDTH 1                         /* 1 ray */
#define RTI_LANES RTI_LANES_FLOAT
#define RTI_SUFFIX _1
#define RTI_FMA 0
#define RTI_TARGET
#include RT_SELF

#if RTI_SINGLE_FMA
#define RTI_WIDTH 1                         /* 1 ray, where the processor has AVX2 and FMA */
#define RTI_LANES RTI_LANES_FLOAT
#define RTI_SUFFIX _1_avx2
#define RTI_FMA 1
#define RTI_TARGET RTI_TARGET_AVX2
#include RT_SELF
#endif

#if RTI_PACKETS && RTI_X86
#define RTI_WIDTH 4                         /* 2 x 2 rays */
#define RTI_LANES RTI_LANES_SSE2
#define RTI_SUFFIX _4
#define RTI_FMA 0
#define RTI_TARGET
#include RT_SELF

#define RTI_WIDTH 8                         /* 8 rays */
#define RTI_LANES RTI_LANES_AVX2
#define RTI_SUFFIX _8
#define RTI_FMA 1
#define RTI_TARGET RTI_TARGET_AVX2
#include RT_SELF
#elif RTI_PACKETS
#define RTI_WIDTH 4                         /* 2 x 2 rays, in plain C */
#define RTI_LANES RTI_LANES_ARRAY
#define RTI_SUFFIX _4
#define RTI_FMA 0
#define RTI_TARGET
#include RT_SELF
#endif
#undef RTI_PASS

/* ---- >>algorithms --------------------------------------------------------------------------------------------------- */

/* The code behind RT_ALGORITHM_LIST: which of them are built, and from which widths. */
static const rt_algorithm_info rti_algorithms[] = {
#define RTI_LARGE(a) (RTI_WIDES && (a) >= RT_BVH_MASKED && (a) <= RT_BVH_PARTITION)
#define RTI_BUILT(a) ((a) == RT_AUTO || (RTI_BVH && (a) == RT_BVH_STACK) || (RTI_WIDES && ((a) == RT_BVH_SIMD || (a) == RT_BVH_WIDE)) || RTI_LARGE(a) || \
                      (RTI_KDTREE && (a) >= RT_KD_STACK && (a) <= RT_KD_BACKTRACK) || \
                      (RTI_THREADED && ((a) == RT_THREADED_SINGLE || (RTI_PACKETS && (a) == RT_THREADED_PARALLEL))))
#define RTI_PACKET(a) (RTI_PACKETS && ((a) == RT_AUTO || (RTI_BVH && ((a) == RT_BVH_SIMD || (a) == RT_BVH_WIDE)) || RTI_LARGE(a) || \
                                       (RTI_KDTREE && (a) >= RT_KD_STACK && (a) < RT_KD_BACKTRACK) || \
                                       (RTI_THREADED && (a) == RT_THREADED_PARALLEL)))
#define RTI_ROW(name, text, structure, what) { text, what, name, structure, RTI_BUILT(name), RTI_PACKET(name), RTI_LARGE(name) },
    RT_ALGORITHM_LIST(RTI_ROW)
};

RT_API const rt_algorithm_info *rt_algorithm_get(size_t i) { return i < RT_ALGORITHM_COUNT ? &rti_algorithms[i] : NULL; }

RT_API rt_isa rt_best_isa(void)
{
#if RTI_X86
    return rti_has_avx2() ? RT_ISA_AVX2 : RT_ISA_SSE2;
#else
    return RT_ISA_SCALAR;
#endif
}

/* The batch function for a width in the rt_packet_widths sense, or, of RT_AUTO, for 0: the one that tries; NULL: not on this processor or
   with this isa. */
static rti_batch_function rti_batch_of(rt_algorithm algorithm, int width, rt_isa isa)
{
    const bool large = RTI_LARGE(algorithm), parallel = algorithm == RT_THREADED_PARALLEL && rti_algorithms[algorithm].built;
    const bool single = algorithm != RT_BVH_SIMD && !large && !parallel && rti_algorithms[algorithm].built;
    const bool packet = rti_algorithms[algorithm].packets && !large && !parallel, tries = packet && algorithm == RT_AUTO && !width;
    if (isa == RT_ISA_AUTO) isa = rt_best_isa();
#if RTI_WIDES
    if (algorithm == RT_BVH_WIDE) {
        const bool single_rays = width == 1, packets = width == 4 || width == 8 || width == 16;
#if RTI_X86
        if (isa == RT_ISA_AVX2) return single_rays ? rti_batch_8 : packets ? rti_batch_crowds_8 : NULL;
#endif
        return single_rays ? rti_batch_4 : packets ? rti_batch_crowds_4 : NULL;
    }
#endif
#if RTI_SINGLE_FMA
    if (single && width == 1 && isa == RT_ISA_AVX2) return rti_batch_1_avx2;
#endif
    if (single && width == 1) return rti_batch_1;
#if RTI_PACKETS
    if (packet && width == 2) return rti_batch_4;
#if RTI_X86
    if (packet && width == 8 && isa == RT_ISA_AVX2) return rti_batch_8;
#endif
#if RTI_THREADED
    if (parallel && (width == 2 || width == 4)) return rti_batch_parallel_4;
#if RTI_X86
    if (parallel && (width == 8 || width == 16) && isa == RT_ISA_AVX2) return rti_batch_parallel_8;
#endif
    if (parallel && (width == 8 || width == 16)) return rti_batch_parallel_4;
#endif
#endif
#if RTI_WIDES
#if RTI_X86
    if (tries && isa == RT_ISA_AVX2) return rti_batch_auto_8;
    if (large && width == RT_MAX_PACKET && isa == RT_ISA_AVX2) return rti_batch_largest_8;
    if (large && (width == 4 || width == 8 || width == 16) && isa == RT_ISA_AVX2) return rti_batch_large_8;
#endif
    if (tries) return rti_batch_auto_4;
    if (large && width == RT_MAX_PACKET) return rti_batch_largest_4;
    if (large && (width == 4 || width == 8 || width == 16)) return rti_batch_large_4;
#endif
    (void)packet, (void)large, (void)parallel, (void)tries;
    return NULL;
}

static size_t rti_widths(rt_algorithm algorithm, rt_isa isa, int *widths, size_t max)
{
    static const int all[] = { 1, 2, 4, 8, 16, RT_MAX_PACKET };
    size_t i, n = 0;
    for (i = 0; i < sizeof all / sizeof all[0]; i++)
        if (rti_batch_of(algorithm, all[i], isa)) {
            if (n < max) widths[n] = all[i];
            n++;
        }
    return n;
}

RT_API size_t rt_packet_widths(rt_algorithm algorithm, int *widths, size_t max)
{
    return (unsigned)algorithm < RT_ALGORITHM_COUNT ? rti_widths(algorithm, RT_ISA_AUTO, widths, max) : 0;
}

/* ---- >>public ------------------------------------------------------------------------------------------------------- */

RT_API const char *rt_status_string(rt_status status)
{
    static const char *const texts[] = { RT_STATUS_LIST(RTI_NAME) };
    return (unsigned)status < RT_STATUS_COUNT ? texts[status] : "unknown status";
}

/* Has accel the tree of RT_BVH_WIDE? */
static bool rti_has_wide(const rt_accel *accel)
{
#if RTI_WIDES
    return accel->wides || (accel->structure == RT_BVH && !accel->node_count);
#else
    (void)accel;
    return false;
#endif
}

static void rti_set_single(rt_accel *accel)
{
    const bool wide = rti_has_wide(accel);
    const rti_batch_function batch = rti_batch_of(wide ? RT_BVH_WIDE : RT_AUTO, 1, RT_ISA_AUTO);
    int query;
    accel->single = batch;
    accel->single_jobs = wide ? rti_wide_jobs : rti_plain_jobs;
    for (query = 0; query < 2; query++) {
#define RTI_SINGLE(suffix) if (batch == rti_batch##suffix) accel->single_walks[query] = rti_single_walk##suffix(accel, &accel->single_jobs[query])
        RTI_SINGLE(_1);
#if RTI_SINGLE_FMA
        RTI_SINGLE(_1_avx2);
#endif
#if RTI_PACKETS
        RTI_SINGLE(_4);
#if RTI_X86
        RTI_SINGLE(_8);
#endif
#endif
#undef RTI_SINGLE
        RT_ASSERT(accel->single_walks[query]);
    }
}

RT_API bool rt_intersect(const rt_accel *accel, const rt_ray *ray, rt_hit *hit)
{
    accel->single(accel, &accel->single_jobs[RT_CLOSEST], ray, 1, hit);
    return hit->prim != RT_NONE;
}

RT_API bool rt_occluded(const rt_accel *accel, const rt_ray *ray)
{
    rt_hit hit;
    accel->single(accel, &accel->single_jobs[RT_ANY], ray, 1, &hit);
    return hit.prim != RT_NONE;
}

/* Parts that an accel may have been built without, */
enum { RTI_PART_BINARY, RTI_PART_WIDE, RTI_PART_LINKS, RTI_PARTS };
static const struct { const char *name, *option, *others; } rti_parts[RTI_PARTS] = {
    { "the binary tree", "no_binary", "bvh.wide and auto do not" },
    { "wide nodes", "no_wide", "the other bvh algorithms do not" },
    { "parent links", "no_backtrack", "the other kd algorithms do not" }
};

/* that it has, as bits, */
static unsigned rti_parts_of(const rt_accel *accel)
{
    unsigned parts = rti_only_wide(accel) ? 0 : 1u << RTI_PART_BINARY;
    if (rti_has_wide(accel)) parts |= 1u << RTI_PART_WIDE;
#if RTI_KDTREE
    if (accel->kdlinks || !accel->node_count) parts |= 1u << RTI_PART_LINKS;
#endif
    return parts;
}

/* and the one that an algorithm reads, or RTI_PARTS. */
static int rti_part_read(size_t algorithm)
{
    return algorithm == RT_KD_BACKTRACK ? RTI_PART_LINKS : algorithm == RT_BVH_WIDE ? RTI_PART_WIDE
         : rti_algorithms[algorithm].structure == RT_BVH ? RTI_PART_BINARY : RTI_PARTS;
}

/* Is all that opt says allowed, for an accel of that structure with those parts? */
static rt_status rti_check_options(const rt_trace_options *opt, rt_structure structure, unsigned parts)
{
    const unsigned lacks = ~parts & ((1u << RTI_PARTS) - 1);
    const rt_algorithm_info *info;
    int read;
    if ((unsigned)opt->algorithm >= RT_ALGORITHM_COUNT)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "algorithm %d is none of rt_algorithm", (int)opt->algorithm);
    if ((unsigned)opt->cull >= RT_CULL_COUNT)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "cull %d is none of rt_cull", (int)opt->cull);
    if ((unsigned)opt->query > RT_ANY)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "query %d is none of rt_query", (int)opt->query);
    info = &rti_algorithms[opt->algorithm];
    if (info->structure != RT_STRUCTURE_COUNT && info->structure != structure) {
        char list[128] = "";
        size_t used = 0, i;
        for (i = 0; i < RT_ALGORITHM_COUNT; i++)
            if (rti_algorithms[i].built && (rti_algorithms[i].structure == structure || i == RT_AUTO) && !(lacks >> rti_part_read(i) & 1))
                used += (size_t)snprintf(list + used, sizeof list - used, used ? ", %s" : "%s", rti_algorithms[i].name);
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "algorithm %s is for a %s; this accel is a %s and takes: %s", info->name,
                        rti_structure_names[info->structure], rti_structure_names[structure], list);
    }
    read = rti_part_read(opt->algorithm);
    if (lacks >> read & 1)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "algorithm %s needs %s, which this accel was built without (%s); %s", info->name,
                        rti_parts[read].name, rti_parts[read].option, rti_parts[read].others);
    if (opt->short_stack < 0 || opt->short_stack > RT_MAX_SHORT_STACK)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "short_stack is %d: it must be 0 (as 3) or between 1 and %d entries",
                        opt->short_stack, RT_MAX_SHORT_STACK);
    if (opt->cull != RT_CULL_NONE && !info->culls)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "algorithm %s has no frustum to cull with: cull must be none", info->name);
    return RT_OK;
}

static rt_status rti_no_width(const rt_trace_options *opt, const int *widths, size_t n)
{
    char list[64] = "";
    size_t used = 0, i;
    for (i = 0; i < n; i++) used += (size_t)snprintf(list + used, sizeof list - used, i ? ", %d" : "%d", widths[i]);
    return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "algorithm %s takes packet_width 0 (default) or one of: %s; not %d",
                    rti_algorithms[opt->algorithm].name, list, opt->packet_width);
}

/* Resolves and checks everything of opt once: the batch function and its job, or an error. RT_AUTO tries on a BVH, see rti_batch_auto; elsewhere,
   and for a few rays, it takes the widest packets, which measure faster than single rays even on diffuse bounces there, and single rays where
   there are too few for a packet. */
static rt_status rti_choose(const rt_accel *accel, const rt_trace_options *opt, size_t count, rti_batch_function *batch, rti_job *job)
{
    static const char *const isas[] = { RT_ISA_LIST(RTI_NAME) };
    const rt_algorithm_info *info;
    int widths[8], width;
    size_t n;
    bool has_isa, wide;
    rt_status status;
    if ((unsigned)opt->algorithm < RT_ALGORITHM_COUNT && !rti_algorithms[opt->algorithm].built) {
        info = &rti_algorithms[opt->algorithm];
        return rti_fail(opt->error, RT_ERROR_UNSUPPORTED, RT_NONE, "algorithm %s (structure %s) is not built", info->name,
                        rti_structure_names[info->structure]);
    }
    if ((unsigned)opt->isa >= RT_ISA_COUNT)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "isa %d is none of rt_isa", (int)opt->isa);
    if ((status = rti_check_options(opt, accel->structure, rti_parts_of(accel))) != RT_OK) return status;
    info = &rti_algorithms[opt->algorithm];
    has_isa = RTI_X86 ? opt->isa != RT_ISA_SCALAR && (opt->isa != RT_ISA_AVX2 || rt_best_isa() == RT_ISA_AVX2)
                      : opt->isa == RT_ISA_AUTO || opt->isa == RT_ISA_SCALAR;
    if (!has_isa)
        return rti_fail(opt->error, RT_ERROR_UNSUPPORTED, RT_NONE, "isa %s is not built or not on this processor", isas[opt->isa]);
    n = rti_widths(opt->algorithm, opt->isa, widths, 8);
    wide = opt->algorithm == RT_BVH_WIDE;
    width = opt->packet_width;
    if (!width) {
        if (RTI_LARGE(opt->algorithm)) width = 16;
        else if (opt->algorithm == RT_THREADED_PARALLEL) width = 8;
        else if (opt->algorithm == RT_BVH_WIDE) width = 1;
        else if (opt->algorithm != RT_AUTO) width = widths[n - 1];
        else if (count < 4) width = 1;
        else if (rti_has_wide(accel) && (count < RTI_AUTO_RAYS / 4 || rti_only_wide(accel))) {
            wide = true;
            width = 16;
        } else if (!RTI_WIDES || accel->structure != RT_BVH || count < RTI_AUTO_RAYS / 4) width = widths[n - 1];     /* else 0: by trying */
    }
    wide = wide || (opt->algorithm == RT_AUTO && width == 1 && rti_has_wide(accel));
    *batch = rti_batch_of(wide ? RT_BVH_WIDE : opt->algorithm, width, opt->isa);
    if (!*batch) return rti_no_width(opt, widths, n);
    job->query = opt->query;
#if RTI_STATS
    job->stats = opt->stats;
#else
    job->stats = NULL;
#endif
    job->algorithm = info->structure == RT_KDTREE ? opt->algorithm : RT_KD_STACK;
    job->entries = job->algorithm != RT_KD_SHORTSTACK ? 0 : opt->short_stack ? opt->short_stack : 3;
    job->large = opt->algorithm;
    job->side = width;
    job->cull = opt->cull;
    job->times = opt->times;
    job->wide = wide || rti_only_wide(accel);
    job->single = false;
    job->tuner = NULL;
    job->from = NULL;
    job->to = NULL;
    return RT_OK;
}

/* What every batch needs; *options becomes defaults where it is NULL. */
static rt_status rti_check_call(const rt_accel *accel, const rt_trace_options **options, rt_trace_options *defaults, size_t count)
{
    const rt_trace_options *opt;
    memset(defaults, 0, sizeof *defaults);
    if (!*options) *options = defaults;
    opt = *options;
    if (!accel) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "accel is NULL");
    if (count > SIZE_MAX / 2 / sizeof(rt_ray)) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "count is negative, or too large");
    return RT_OK;
}

RT_API rt_status rt_trace(const rt_accel *accel, const rt_trace_options *opt, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rt_trace_options defaults;
    rti_batch_function batch;
    rti_job job;
    rt_status status;
    if ((status = rti_check_call(accel, &opt, &defaults, count)) != RT_OK) return status;
    if (count && (!rays || !hits)) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", rays ? "hits" : "rays");
    if ((status = rti_choose(accel, opt, count, &batch, &job)) != RT_OK) return status;
    batch(accel, &job, rays, count, hits);
    return RT_OK;
}

RT_API rt_status rt_trace_arrays(const rt_accel *accel, const rt_trace_options *opt, const rt_ray_arrays *rays, size_t count,
                                 const rt_hit_arrays *hits)
{
    static const char axes[] = "xyz";
    rt_trace_options defaults;
    rti_batch_function batch;
    rti_job job;
    rt_status status;
    int k;
    if ((status = rti_check_call(accel, &opt, &defaults, count)) != RT_OK) return status;
    if (!rays || !hits) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", rays ? "hits" : "rays");
    for (k = 0; k < 3 && count; k++)
        if (!rays->org[k] || !rays->dir[k])
            return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "rays lack their %s.%c", rays->org[k] ? "dir" : "org", axes[k]);
    if ((status = rti_choose(accel, opt, count, &batch, &job)) != RT_OK) return status;
    job.from = rays;
    job.to = hits;
    batch(accel, &job, NULL, count, NULL);
    return RT_OK;
}

/* ---- >>leaving ------------------------------------------------------------------------------------------------------ */

/* A point of a primitive in the primitive's space, the unit normal there, and how far rounding may move both apart for a ray from beside it. */
typedef struct { double point[3], normal[3], bound; } rti_anchor;

/* Sums and products are rounded one by one, whatever the compiler would contract. */
static double rti_dot3(const double a[3], const double b[3])
{
    const double sum = rti_round(a[0] * b[0]) + rti_round(a[1] * b[1]);
    return sum + rti_round(a[2] * b[2]);
}

static void rti_cross3(const double a[3], const double b[3], double out[3])
{
    int k;
    for (k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        out[k] = rti_round(a[k1] * b[k2]) - rti_round(a[k2] * b[k1]);
    }
}

/* The length, to which 1 is made; 0 stays. Numbers of 1e-60 to 1e60 have squares. */
static double rti_unit3(double a[3])
{
    const double length = sqrt(rti_dot3(a, a));
    int k;
    for (k = 0; k < 3 && length > 0; k++) a[k] /= length;
    return length;
}

/* Moves the point to the nearest one that keeps off the triangle's edges, side[i] from vertex i + 1 to i + 2, by margin, or, where that is more, by
   the radius of the circle within: those are a smaller triangle around the same centre. */
static void rti_keep_inside(const float v[9], double side[3][3], const double normal[3], double margin, double point[3])
{
    double lengths[3], around = 0, center[3], at[3][3], best[3], least = HUGE_VAL, radius = HUGE_VAL;
    bool inside = true;
    int i, k;
    for (i = 0; i < 3; i++) around += lengths[i] = sqrt(rti_dot3(side[i], side[i]));
    for (k = 0; k < 3; k++)
        center[k] = (rti_round(lengths[0] * (double)v[k]) + rti_round(lengths[1] * (double)v[3 + k]) + rti_round(lengths[2] * (double)v[6 + k])) / around;
    for (i = 0; i < 3; i++) {
        double inward[3], off[3], to[3];
        rti_cross3(normal, side[i], inward);
        (void)rti_unit3(inward);
        for (k = 0; k < 3; k++) {
            off[k] = point[k] - (double)v[3 * ((i + 1) % 3) + k];
            to[k] = center[k] - (double)v[3 * ((i + 1) % 3) + k];
        }
        inside = inside && rti_dot3(off, inward) >= margin;
        radius = fmin(radius, rti_dot3(to, inward));
    }
    if (inside) return;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) at[i][k] = (double)v[3 * i + k] + rti_round(fmin(margin / radius, 1) * (center[k] - (double)v[3 * i + k]));
    for (i = 0; i < 3; i++) {               /* the nearest point of each of its edges */
        const double *const from = at[(i + 1) % 3];
        double along[3], off[3], found[3], part;
        for (k = 0; k < 3; k++) along[k] = at[(i + 2) % 3][k] - from[k], off[k] = point[k] - from[k];
        part = rti_dot3(off, along) / rti_dot3(along, along);
        part = part > 0 ? fmin(part, 1) : 0;
        for (k = 0; k < 3; k++) found[k] = from[k] + rti_round(part * along[k]), off[k] = found[k] - point[k];
        part = rti_dot3(off, off);
        if (part < least) least = part, memcpy(best, found, sizeof best);
    }
    memcpy(point, best, sizeof best);
}

/* What the coordinates of the origin, seen from the primitive, may err by: m is the place of that in the world, or NULL, inverse what undoes m's
   3x3. Answers the most along the normal. */
static double rti_blur(const rti_anchor *s, const float m[12], const double inverse[9], double blur[3])
{
    double sum = 0;
    int i, j, k;
    for (k = 0; k < 3; k++) {
        double size = 2 * fabs(s->point[k]);            /* rounded: to half of its last place, with another to spare */
        for (i = 0; i < 3 && m; i++) {
            double there = 2 * fabs((double)m[4 * i + 3]);
            for (j = 0; j < 3; j++) there += rti_round(fabs((double)m[4 * i + j]) * fabs(s->point[j]));
            size += 8 * rti_round(fabs(inverse[3 * k + i]) * there);        /* of the origin, and of matrices there and back */
        }
        blur[k] = size * (1.0 / 16777216) + 1e-44;
        sum += rti_round(fabs(s->normal[k]) * blur[k]);
    }
    return sum;
}

/* The inverse of m's 3x3. */
static void rti_undo(const float m[12], double inverse[9])
{
    double rows[3][3], det;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) rows[i][j] = (double)m[4 * i + j];
    for (i = 0; i < 3; i++) {
        double column[3];
        rti_cross3(rows[(i + 1) % 3], rows[(i + 2) % 3], column);
        for (j = 0; j < 3; j++) inverse[3 * j + i] = column[j];
    }
    det = rti_round(rows[0][0] * inverse[0]) + rti_round(rows[0][1] * inverse[3]);
    det += rti_round(rows[0][2] * inverse[6]);
    for (i = 0; i < 9; i++) inverse[i] /= det;
}

RT_API rt_vec3 rt_spawn_origin(const rt_geometry *geo, const float transform[12], const rt_ray *ray, const rt_hit *hit, rt_vec3 dir)
{
    const size_t triangles = geo->triangle_count;
    const double world_org[3] = { (double)ray->org.x, (double)ray->org.y, (double)ray->org.z };
    const double world_dirs[2][3] = { { (double)dir.x, (double)dir.y, (double)dir.z }, { (double)ray->dir.x, (double)ray->dir.y, (double)ray->dir.z } };
    double inverse[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, org[3], dirs[2][3], blur[3], up, within = HUGE_VAL;
    rti_anchor s;
    rt_vec3 out;
    int i, k;
    RT_ASSERT(hit->prim != RT_NONE);
    memset(&s, 0, sizeof s);
    if (transform) rti_undo(transform, inverse);
    for (k = 0; k < 3; k++) {
        double off[3];
        for (i = 0; i < 3; i++) off[i] = world_org[i] - (transform ? (double)transform[4 * i + 3] : 0);
        org[k] = rti_dot3(inverse + 3 * k, off);
        for (i = 0; i < 2; i++) dirs[i][k] = rti_dot3(inverse + 3 * k, world_dirs[i]);
        s.point[k] = org[k] + rti_round((double)hit->t * dirs[1][k]);
    }
    if (hit->prim < triangles) {
        double side[3][3], reach = 0;
        float v[9];
        (void)rti_fetch_triangle(geo, hit->prim, v);
        for (i = 0; i < 3; i++)
            for (k = 0; k < 3; k++) side[i][k] = (double)v[3 * ((i + 2) % 3) + k] - (double)v[3 * ((i + 1) % 3) + k];
        rti_cross3(side[0], side[1], s.normal);
        (void)rti_unit3(s.normal);
        for (k = 0; k < 3; k++) {
            s.point[k] = (double)v[k] + rti_round((double)hit->u * side[2][k]) - rti_round((double)hit->v * side[1][k]);
            for (i = 0; i < 3; i++) reach = fmax(reach, fabs((double)v[3 * i + k] - s.point[k]));
        }
        reach *= 1.5 / 1048576;             /* 16 roundings of vertices, see rti_hit_triangle, across and up */
        s.bound = reach + rti_blur(&s, transform, inverse, blur);
        rti_keep_inside(v, side, s.normal, 8 * reach + 4 * (blur[0] + blur[1] + blur[2]), s.point);
    }
#if RTI_SPHERES
    else if (hit->prim - triangles < geo->sphere_count) {
        const rt_sphere *ball = &geo->spheres[hit->prim - triangles];
        const double center[3] = { (double)ball->center.x, (double)ball->center.y, (double)ball->center.z };
        double to[3], off[3], nearest, half;
        for (k = 0; k < 3; k++) to[k] = center[k] - org[k];
        nearest = rti_dot3(to, dirs[1]) / rti_dot3(dirs[1], dirs[1]);
        for (k = 0; k < 3; k++) off[k] = to[k] - rti_round(nearest * dirs[1][k]);
        half = rti_round((double)ball->radius * (double)ball->radius) - rti_dot3(off, off);
        half = half > 0 ? sqrt(half / rti_dot3(dirs[1], dirs[1])) : 0;
        nearest += (double)hit->t < nearest ? -half : half;             /* t again: of a small sphere afar, a float is far from it */
        for (k = 0; k < 3; k++) s.normal[k] = rti_round(nearest * dirs[1][k]) - to[k];
        (void)rti_unit3(s.normal);
        for (k = 0; k < 3; k++) s.point[k] = center[k] + rti_round((double)ball->radius * s.normal[k]);
        s.bound = 1e-12 * (double)ball->radius + rti_blur(&s, transform, inverse, blur);
        within = (double)ball->radius;      /* at most to the centre */
    }
#endif
#if RTI_PLANES
    else {
        const rt_plane *plane = &geo->planes[hit->prim - triangles - rti_sphere_count(geo) - rti_instance_count(geo)];
        const double point[3] = { (double)plane->point.x, (double)plane->point.y, (double)plane->point.z };
        double off[3], above;
        s.normal[0] = (double)plane->normal.x, s.normal[1] = (double)plane->normal.y, s.normal[2] = (double)plane->normal.z;
        (void)rti_unit3(s.normal);
        for (k = 0; k < 3; k++) off[k] = s.point[k] - point[k];
        above = rti_dot3(off, s.normal);
        for (k = 0; k < 3; k++) s.point[k] -= rti_round(above * s.normal[k]);
        s.bound = 1e-12 * sqrt(rti_dot3(off, off)) + rti_blur(&s, transform, inverse, blur);
    }
#endif
    up = rti_dot3(s.normal, dirs[0]);
    if (up == 0) up = -rti_dot3(s.normal, dirs[1]);
    for (k = 0; k < 3; k++) s.point[k] += rti_round((up < 0 ? -fmin(s.bound, within) : s.bound) * s.normal[k]);
    for (k = 0; k < 3 && transform; k++) org[k] = (double)transform[4 * k + 3] + rti_round((double)transform[4 * k] * s.point[0]) +
        rti_round((double)transform[4 * k + 1] * s.point[1]) + rti_round((double)transform[4 * k + 2] * s.point[2]);
    if (transform) memcpy(s.point, org, sizeof s.point);
    out.x = (float)s.point[0], out.y = (float)s.point[1], out.z = (float)s.point[2];
    return out;
}

/* ---- >>sampling ----------------------------------------------------------------------------------------------------- */

/* Integers and floats alone, without a library: the same numbers from every compiler. */

#endif
#if RTI_IN(SHADING)
#if RTI_SAMPLING || !defined(RT_NO_SHADING)
/* The finaliser of MurmurHash3: a permutation in which every bit depends on every other. */
RTI_SHARED(
static uint32_t rti_hash(uint32_t x)
{
    x = (x ^ x >> 16) * 0x85ebca6bu;
    x = (x ^ x >> 13) * 0xc2b2ae35u;
    return x ^ x >> 16;
}
)
#endif

#if RTI_SAMPLING

RTI_SHARED(
static uint32_t rti_hash_next(uint32_t hash, uint32_t x) { return rti_hash(hash + x * 0x9e3779b9u + 0x7f4a7c15u); }

static float rti_unit_float(uint32_t x) { return (float)(x >> 8) * (1.0f / 16777216); }
)

/* What tells the numbers of one pixel from another's; with the dimension, all that tells one set of samples from another. */
RTI_SHARED(
static uint32_t rti_pixel_key(const rt_sampler *sampler, uint32_t x, uint32_t y)
{
    uint32_t hash = rti_hash_next(rti_hash(sampler->seed), sampler->frame);
    hash = rti_hash_next(hash, x);
    return rti_hash_next(hash, y);
}
)

/* Where i of n goes in a shuffled order: a permutation of the next power of 2, again until it lands below n (Kensler 2013). */
RTI_SHARED(
static uint32_t rti_shuffle(uint32_t i, uint32_t n, uint32_t key)
{
    uint32_t mask = n - 1, bits = 0, a, b, c, d;
    mask |= mask >> 1;
    mask |= mask >> 2;
    mask |= mask >> 4;
    mask |= mask >> 8;
    mask |= mask >> 16;
    while (mask >> bits) bits++;
    if (!bits) return 0;
    a = rti_hash_next(key, 1);
    b = rti_hash_next(key, 2);
    c = rti_hash_next(key, 3);
    d = rti_hash_next(key, 4);
    do {                                    /* each step can be undone within the mask */
        i = (i ^ a) & mask;
        i = i * (b | 1) & mask;
        i ^= i >> (bits + 1) / 2;
        i = (i + c) & mask;
        i = i * (d << 1 | 1) & mask;
        i ^= i >> (bits + 2) / 3;
        i = i * ((a ^ d) | 1) & mask;
        i ^= i >> (bits + 1) / 2;
        i = (i + b) & mask;
    } while (i >= n);
    return i;
}
)

RTI_SHARED(
RTI_INLINE uint32_t rti_reverse(uint32_t x)
{
    x = x << 16 | x >> 16;
    x = (x & 0x00ff00ffu) << 8 | (x & 0xff00ff00u) >> 8;
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
}
)

/* Owen's scrambling of reversed bits: whether one is flipped depends on all that are below it, since a product, and a sum, carry upwards
   only; so does what is xored with an even product (Laine and Karras 2011). */
RTI_SHARED(
RTI_INLINE uint32_t rti_owen(uint32_t x, uint32_t key)
{
    x ^= x * 0x3c6ef372u;
    x += key;
    x *= key >> 15 | 1;
    x ^= x * 0x1b56c4eau;
    x ^= x * 0xa54ff53au;
    x *= key << 1 | 1;
    return x ^ x * 0x510e527eu;
}
)

/* Sobol' points in sixteen dimensions at once. Digits of a sample's number, as a vector, times the matrix of a dimension are the digits of its
   coordinate. All matrices are Pascal's triangle, of blocks (c over r) a^(c - r). a = 0, 1 in the field of two elements are the two
   dimensions of Sobol', the first of them van der Corput's, of which 2^m points lie in as many fields, whatever the fields' shape. The
   four a of the field of four, 0, 1, w, w + 1, are Faure's, of which 4^m points do so in four dimensions, and those of the field of sixteen,
   16^m in sixteen. All three hold at once for the matrices 1, P, W, PW, A, PA, WA, PWA and so on, where P is Pascal's for 1, W for w, and A for
   three elements of the field of sixteen: but for an order within digits P is also that of the larger fields for 1, and W that of the
   largest for w, and the triangles of a and b multiply to that of a + b (after Ahmed et al. 2024). As c over r is odd where the bits of r
   are among those of c, a triangle is a product of steps, one for each bit of c - r. */
RTI_SHARED(
RTI_INLINE uint32_t rti_pascal(uint32_t x)
{
    x ^= x >> 1 & 0x55555555u;
    x ^= x >> 2 & 0x33333333u;
    x ^= x >> 4 & 0x0f0f0f0fu;
    x ^= x >> 8 & 0x00ff00ffu;
    return x ^ x >> 16;
}
/* Digits of four bits times an element of the field of sixteen, whose last four bits stand for 1, w, g and w g: w^2 = w + 1, g^2 = g + w.
   1 and w take digits of two bits, of the field of four, as well. */
RTI_INLINE uint32_t rti_times_w(uint32_t x)
{
    const uint32_t low = x & 0x55555555u, high = x >> 1 & 0x55555555u;
    return high | (low ^ high) << 1;
}
RTI_INLINE uint32_t rti_times(uint32_t x, uint32_t element)
{
    const uint32_t low = x & 0x33333333u, high = x >> 2 & 0x33333333u, by_g = rti_times_w(high) | (low ^ high) << 2;
    uint32_t y = element & 1 ? x : 0;
    if (element & 2) y ^= rti_times_w(x);
    if (element & 4) y ^= by_g;
    if (element & 8) y ^= rti_times_w(by_g);
    return y;
}
RTI_INLINE uint32_t rti_pascal_w(uint32_t x)
{
    x ^= rti_times(x >> 2 & 0x33333333u, 2);
    x ^= rti_times(x >> 4 & 0x0f0f0f0fu, 3);
    x ^= rti_times(x >> 8 & 0x00ff00ffu, 2);
    return x ^ rti_times(x >> 16, 3);
}
/* For w^2 g + w, w g or g + w, which are, with 0, those of which two dimensions are the least alike where no 16^m points are complete. */
RTI_INLINE uint32_t rti_pascal_16(uint32_t x, uint32_t which)
{
    const uint32_t powers = which == 1 ? 0xd8eu : which == 2 ? 0xad8u : 0x756u;        /* a^4, a^2, a */
    x ^= rti_times(x >> 4 & 0x0f0f0f0fu, powers);
    x ^= rti_times(x >> 8 & 0x00ff00ffu, powers >> 4);
    return x ^ rti_times(x >> 16, powers >> 8);
}
/* Sample i is that one of the points. Eight dimensions, of two numbers each, are shuffled alike. */
RTI_INLINE uint32_t rti_shuffle_sobol(uint32_t i, uint32_t pixel_key, uint32_t dimension)
{
    i = rti_reverse(rti_owen(rti_reverse(i), rti_hash_next(pixel_key, dimension >> 3)));
    if (dimension & 6) i = rti_pascal_16(i, dimension >> 1 & 3);
    return dimension & 1 ? rti_pascal_w(i) : i;
}
RTI_INLINE float rti_sobol(uint32_t x, uint32_t key) { return rti_unit_float(rti_reverse(rti_owen(x, key))); }
)

RTI_SHARED(
static float rti_sample_1d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension)
{
    const uint32_t pixel_key = rti_pixel_key(sampler, x, y), key = rti_hash_next(pixel_key, dimension), n = sampler->spp ? sampler->spp : 1;
    if (sampler->kind == RT_SAMPLER_INDEPENDENT) return rti_unit_float(rti_hash_next(key, sample));
    if (sampler->kind == RT_SAMPLER_STRATIFIED) {
        const float u = ((float)rti_shuffle(sample % n, n, key) + rti_unit_float(rti_hash_next(key, sample))) / (float)n;
        return u < 1 ? u : 0.99999994f;
    }
    return rti_sobol(rti_shuffle_sobol(sample, pixel_key, dimension), rti_hash_next(key, 0));
}
)
RTI_SHARED(
static void rti_sample_2d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension, float point[2])
{
    const uint32_t pixel_key = rti_pixel_key(sampler, x, y), key = rti_hash_next(pixel_key, dimension), n = sampler->spp ? sampler->spp : 1;
    int k;
    if (sampler->kind == RT_SAMPLER_INDEPENDENT) {
        const uint32_t hash = rti_hash_next(key, sample);
        point[0] = rti_unit_float(hash);
        point[1] = rti_unit_float(rti_hash_next(hash, 1));
    } else if (sampler->kind == RT_SAMPLER_STRATIFIED) {
        /* Multi-jittering (Chiu et al. 1994): each coordinate by itself is stratified n-fold too. */
        const uint32_t hash = rti_hash_next(key, sample), s = rti_shuffle(sample % n, n, key);
        uint32_t columns = (uint32_t)sqrtf((float)n), rows, column, row, across;      /* exact: n is at most 2^20 */
        rows = (n + columns - 1) / columns;
        row = s / columns;
        column = rti_shuffle(s % columns, columns, rti_hash_next(key, 5));
        across = n - row * columns < columns ? n - row * columns : columns;     /* of the last row */
        point[0] = ((float)column + ((float)rti_shuffle(row, rows, rti_hash_next(key, 6 + column)) + rti_unit_float(hash)) / (float)rows) /
                   (float)columns;
        point[1] = ((float)(row * columns + rti_shuffle(s % columns, across, rti_hash_next(key ^ 0x68bc21ebu, row))) +
                    rti_unit_float(rti_hash_next(hash, 1))) / (float)n;
    } else {
        const uint32_t i = rti_shuffle_sobol(sample, pixel_key, dimension);
        point[0] = rti_sobol(i, rti_hash_next(key, 0));
        point[1] = rti_sobol(rti_pascal(i), rti_hash_next(key, 1));
    }
    for (k = 0; k < 2; k++)                 /* what rounding has made 1 */
        if (!(point[k] < 1)) point[k] = 0.99999994f;
}
)
#endif
#endif
#if RTI_IN(HOST)

#if RTI_SAMPLING
RT_API float rt_sample_1d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension)
{
    return rti_sample_1d(sampler, x, y, sample, dimension);
}

RT_API void rt_sample_2d(const rt_sampler *sampler, uint32_t x, uint32_t y, uint32_t sample, uint32_t dimension, float point[2])
{
    rti_sample_2d(sampler, x, y, sample, dimension, point);
}

#endif

/* ---- >>camera ------------------------------------------------------------------------------------------------------- */

#endif
#if RTI_IN(SHADING) && !defined(RT_NO_SHADING)
/* Products are rounded before they are summed: every compiler, whatever its flags, and every device draw the same picture. */
RTI_SHARED(
static rt_vec3 rti_vec3(float x, float y, float z)
{
    rt_vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
static rt_vec3 rti_add(rt_vec3 a, rt_vec3 b) { return rti_vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
static rt_vec3 rti_sub(rt_vec3 a, rt_vec3 b) { return rti_vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
static rt_vec3 rti_mul(rt_vec3 a, rt_vec3 b) { return rti_vec3(rti_keepf(a.x * b.x), rti_keepf(a.y * b.y), rti_keepf(a.z * b.z)); }
static rt_vec3 rti_scale(rt_vec3 a, float s) { return rti_vec3(rti_keepf(a.x * s), rti_keepf(a.y * s), rti_keepf(a.z * s)); }
static float rti_dot(rt_vec3 a, rt_vec3 b) { return rti_keepf(a.x * b.x) + rti_keepf(a.y * b.y) + rti_keepf(a.z * b.z); }
static float rti_minor(float a, float b, float c, float d) { return rti_keepf(a * b) - rti_keepf(c * d); }
static rt_vec3 rti_cross(rt_vec3 a, rt_vec3 b)
{
    return rti_vec3(rti_minor(a.y, b.z, a.z, b.y), rti_minor(a.z, b.x, a.x, b.z), rti_minor(a.x, b.y, a.y, b.x));
}
static float rti_largest(rt_vec3 a)
{
    float x = fabsf(a.x), y = fabsf(a.y), z = fabsf(a.z);
    return x > y ? (x > z ? x : z) : (y > z ? y : z);
}
)

/* Scaled first, so that neither 1e18 nor 1e-30 leaves the range when squared. The zero vector stays. */
RTI_SHARED(
static rt_vec3 rti_normalize(rt_vec3 a)
{
    float m = rti_largest(a);
    if (!(m > 0)) return a;
    a = rti_vec3(a.x / m, a.y / m, a.z / m);
    return rti_scale(a, 1 / sqrtf(rti_dot(a, a)));
}
)

/* Two unit vectors across n, which is one (Duff et al. 2017). */
RTI_SHARED(
RTI_INLINE void rti_frame(rt_vec3 n, rt_vec3 *x, rt_vec3 *y)
{
    const float sign = copysignf(1, n.z), a = -1 / (sign + n.z), b = rti_keepf(n.x * n.y * a);
    *x = rti_vec3(1 + rti_keepf(sign * n.x * n.x * a), sign * b, -sign * n.x);
    *y = rti_vec3(b, sign + rti_keepf(n.y * n.y * a), -n.y);
}
)

RTI_SHARED(
RTI_INLINE void rti_set_ray(rt_ray *ray, rt_vec3 org, rt_vec3 dir, float tmax)
{
    ray->org = org;
    ray->tmin = 0;
    ray->dir = dir;
    ray->tmax = tmax;
}
static rt_ray rti_view_ray(const rti_view *view, float x, float y)
{
    rt_ray ray;
    rti_set_ray(&ray, view->eye, rti_add(view->corner, rti_add(rti_scale(view->right, x), rti_scale(view->down, y))), RTI_INFINITY);
    return ray;
}
)

#if RTI_SAMPLING
/* What a lens adds to a view. */
RTI_SHARED(
typedef struct {
    rt_vec3 right, down;                    /* its radius along both */
    float rfocus;                           /* 1 / depth of focus */
    bool open;                              /* false: a pinhole */
} rti_aperture;
)

/* The square onto the disc, rings onto rings (Shirley and Chiu 1997). */
RTI_SHARED(
static void rti_disc(const float u[2], float out[2])
{
    const float x = 2 * u[0] - 1, y = 2 * u[1] - 1;
    const bool wide = fabsf(x) > fabsf(y);
    const float r = wide ? x : y;
    float sine, cosine;
    rti_circle(r != 0 ? 0.125f * (wide ? y / x : 2 - x / y) : 0, &sine, &cosine);
    out[0] = r * cosine;
    out[1] = r * sine;
}
)

/* Moves a ray of the view to a point of the lens: where it is in focus, at depth 1 / rfocus, it stays. */
RTI_SHARED(
static void rti_through_lens(const rti_aperture *lens, const float u[2], rt_ray *ray)
{
    float at[2];
    rt_vec3 off;
    rti_disc(u, at);
    off = rti_add(rti_scale(lens->right, at[0]), rti_scale(lens->down, at[1]));
    ray->org = rti_add(ray->org, off);
    ray->dir = rti_sub(ray->dir, rti_scale(off, lens->rfocus));
}
)

#endif
#endif
#if RTI_IN(HOST)

#ifndef RT_NO_SHADING
static rti_view rti_make_view(const rt_camera *camera, int width, int height)
{
    rti_view view;
    rt_vec3 forward = rti_normalize(rti_sub(camera->look, camera->eye)), right, down;
    double sine, cosine;
    float pixel;
    rti_sine_cosine(rti_keep((double)camera->fov * 0.00872664625997164788), &sine, &cosine);      /* degrees to half radians */
    pixel = (float)(2 * sine / cosine / height);
    right = rti_cross(forward, rti_normalize(camera->up));
    if (!(rti_dot(right, right) > 0))       /* up along the view axis, or zero: any level right will do */
        right = rti_cross(forward, fabsf(forward.y) < 0.9f ? rti_vec3(0, 1, 0) : rti_vec3(1, 0, 0));
    right = rti_normalize(right);
    down = rti_cross(forward, right);
    view.eye = camera->eye;
    view.right = rti_scale(right, pixel);
    view.down = rti_scale(down, pixel);
    view.corner = rti_sub(forward, rti_add(rti_scale(view.right, (float)width / 2), rti_scale(view.down, (float)height / 2)));
    return view;
}

#if RTI_SAMPLING
static rti_aperture rti_make_aperture(const rt_camera *camera, const rti_view *view, const rt_lens *lens)
{
    const rt_vec3 ahead = rti_sub(camera->look, camera->eye);
    rti_aperture l;
    l.open = lens->radius > 0;
    l.right = rti_scale(rti_normalize(view->right), lens->radius);
    l.down = rti_scale(rti_normalize(view->down), lens->radius);
    l.rfocus = 1 / (lens->focus > 0 ? lens->focus : rti_largest(ahead) / rti_largest(rti_normalize(ahead)));
    return l;
}

RT_API rt_ray rt_lens_ray(const rt_camera *camera, const rt_lens *lens, float x, float y, int width, int height, const float on_lens[2])
{
    rti_view view = rti_make_view(camera, width, height);
    rt_ray ray = rti_view_ray(&view, x, y);
    if (lens->radius > 0) {
        const rti_aperture l = rti_make_aperture(camera, &view, lens);
        rti_through_lens(&l, on_lens, &ray);
    }
    return ray;
}
#endif

RT_API rt_ray rt_camera_ray(const rt_camera *camera, float x, float y, int width, int height)
{
    rti_view view = rti_make_view(camera, width, height);
    return rti_view_ray(&view, x, y);
}

/* ---- >>raster ------------------------------------------------------------------------------------------------------- */

/* [Horn] 4: rasterisation in the place of eye rays. Sort-middle: each primitive is projected once and listed in the tiles that it may be
   seen in; then each block of pixels tests its packets against what its tiles list, with the very test that tracing uses. So projection
   decides only what is tested, and must be conservative, as boxes must (see rti_prepare). No clipping: points stay homogeneous.

   Errors, with e = 2^-24. The camera's ray through (x, y) has the direction d = corner + x right + y down + w, where |w| <= 4 e B in each
   component for the three products and sums, B being the largest that a component can get: 8 e B is taken. rows, in double, of products
   that are exact, is good to 2^-30 (blind otherwise). Row k makes at most sums[k] |w| of w: so d is seen at (x, y, 1) + errors of sums[k]
   8 e B, and divided by its third component, within 1 +- stretch, at most sway pixels beside (x, y). What floats lose of x, of x + dx and
   of differences of them, each e times the picture's width and 16 e taken, is added to that.

   A hit: the sheared vertices of [Woop] move by up to 8 e R sideways, R the vertex's largest distance from the eye along an axis; a ray
   that is accepted meets the triangle of the moved vertices exactly. Along the ray t errs by e R. Hits on spheres and, beyond what
   rti_set_reach says, on instances lie within 16 e R of their boxes. For all of them 32 e R is taken, R being the primitive's farthest; row
   k makes at most sums[k] 32 e R of that. It includes what doubles lose everywhere, 2^-48 R, also where the eye lies in the primitive and
   the sign of t is noise. Smallest floats (or zeros instead, with flush-to-zero) matter where R is small: tiny is added to it.

   The usual camera has sums[0] of two or three times the picture's height, and all of that is a few thousandths of a pixel. A camera
   whose fov is tiny, or near 180 degrees, has many pixels of it: all that its rays' floats leave it. */

static rti_lens rti_make_lens(const rti_view *view, int width, int height)
{
    const double c[3] = { (double)view->corner.x, (double)view->corner.y, (double)view->corner.z };
    const double r[3] = { (double)view->right.x, (double)view->right.y, (double)view->right.z };
    const double d[3] = { (double)view->down.x, (double)view->down.y, (double)view->down.z };
    double det = 0, terms = 0, most = 0, error;
    rti_lens lens;
    int i, k;
    memset(&lens, 0, sizeof lens);
    lens.eye[0] = (double)view->eye.x;
    lens.eye[1] = (double)view->eye.y;
    lens.eye[2] = (double)view->eye.z;
    lens.edge[0] = (float)width;
    lens.edge[1] = (float)height;
    for (k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        double size = fabs(c[k]) + fabs(r[k]) * width + fabs(d[k]) * height;
        lens.rows[0][k] = d[k1] * c[k2] - d[k2] * c[k1];
        lens.rows[1][k] = c[k1] * r[k2] - c[k2] * r[k1];
        lens.rows[2][k] = r[k1] * d[k2] - r[k2] * d[k1];
        det += r[k] * lens.rows[0][k];
        terms += fabs(r[k] * lens.rows[0][k]);
        if (size > most) most = size;
    }
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) {
            lens.rows[i][k] /= det;
            lens.sums[i] += fabs(lens.rows[i][k]);
        }
    error = 4.76837158203125e-07 * most;    /* 8 e B */
    lens.stretch = lens.sums[2] * error;
    lens.tiny = 1e-30 * (1 + most);
    for (k = 0; k < 2; k++)
        lens.sway[k] = (lens.sums[k] * error + (double)lens.edge[k] * lens.stretch) / (1 - lens.stretch) +
                       ((double)lens.edge[k] + RTI_BLOCK) * 9.5367431640625e-07;
    lens.narrow = lens.sums[0] + lens.sums[1] + lens.sums[2] < 1e9;
    lens.blind = !(fabs(det) > terms * 9.5367431640625e-07) || !(lens.stretch < 0.25) || !(lens.sums[0] + lens.sums[1] < 1e60);
    return lens;
}

/* Where the hull of count points, given from the eye, may be seen, rounding moving it and pad as much more. False: nowhere. It is cut at
   the eye plane: x / depth has its least and greatest at corners of what is in front, or goes to +-infinity where the hull crosses it. */
static bool rti_see(const rti_lens *lens, double (*p)[3], int count, double pad, rti_span *span)
{
    double h[8][3], error[3], lo[2] = { HUGE_VAL, HUGE_VAL }, hi[2] = { -HUGE_VAL, -HUGE_VAL }, depth = HUGE_VAL, reach = 0;
    bool front = false, back = false;
    int i, j, k;
    span->depth = 0;
    for (k = 0; k < 2; k++) {
        span->lo[k] = -1;
        span->hi[k] = lens->edge[k] + 1;
    }
    if (lens->blind) return true;
    for (i = 0; i < count; i++)
        for (k = 0; k < 3; k++)
            if (fabs(p[i][k]) > reach) reach = fabs(p[i][k]);
    pad += rti_drift(lens, reach);
    for (k = 0; k < 3; k++) error[k] = lens->sums[k] * pad;
    for (i = 0; i < count; i++) {
        double nearest, farthest;
        rti_project(lens, p[i], h[i]);
        nearest = h[i][2] - error[2];
        farthest = h[i][2] + error[2];
        if (nearest < depth) depth = nearest;
        if (farthest > 0) front = true;
        if (nearest > 0)
            for (k = 0; k < 2; k++) {
                double at = h[i][k] / h[i][2], off = (error[k] + fabs(at) * error[2]) / nearest;
                if (at - off < lo[k]) lo[k] = at - off;
                if (at + off > hi[k]) hi[k] = at + off;
            }
        else {
            back = true;
            for (k = 0; k < 2 && farthest > 0; k++) {
                double from = h[i][k] - error[k], to = h[i][k] + error[k];
                if (!(from > 0)) lo[k] = -HUGE_VAL;
                else if (from / farthest < lo[k]) lo[k] = from / farthest;
                if (!(to < 0)) hi[k] = HUGE_VAL;
                else if (to / farthest > hi[k]) hi[k] = to / farthest;
            }
        }
    }
    if (!front) return false;
    for (i = 0; i < count && back; i++)
        for (j = 0; j < count; j++) {
            if (h[i][2] - error[2] > 0 || !(h[j][2] + error[2] > 0) || i == j) continue;
            for (k = 0; k < 2; k++) {       /* the side on which the line from i to j crosses the plane */
                double side = h[i][k] * h[j][2] - h[j][k] * h[i][2];
                double off = error[k] * (fabs(h[i][2]) + fabs(h[j][2]) + 2 * error[2]) + error[2] * (fabs(h[i][k]) + fabs(h[j][k]));
                if (!(side < -off)) hi[k] = HUGE_VAL;
                if (!(side > off)) lo[k] = -HUGE_VAL;
            }
        }
    for (k = 0; k < 2; k++) {
        lo[k] -= lens->sway[k];
        hi[k] += lens->sway[k];
        if (!(hi[k] >= 0 && lo[k] <= (double)lens->edge[k])) return false;
        if (lo[k] > -1) span->lo[k] = (float)lo[k];
        if (hi[k] < (double)span->hi[k]) span->hi[k] = (float)hi[k];
    }
    depth = depth / (1 + lens->stretch) * 0.999999;
    if (depth > 0) span->depth = depth < 1e38 ? (float)depth : 1e38f;
    return true;
}

/* Fills the span of primitive prim, and the record of an instance. False: it is bad. */
static bool rti_span_of(rt_raster *r, size_t prim, rti_span *span)
{
    const rt_geometry *geo = &r->accel.geo;
    double p[8][3], pad = 0;
    rti_box box;
    int i, k, kind;
    span->lo[0] = span->lo[1] = 1;
    span->hi[0] = span->hi[1] = span->depth = 0;
    if (prim < geo->triangle_count) {
        float v[9];
        bool good = rti_fetch_triangle(geo, prim, v);
        for (k = 0; k < 9 && good; k++) {
            good = rti_coordinate_ok(v[k]);
            p[k / 3][k % 3] = (double)v[k] - r->lens.eye[k % 3];
        }
        if (good && !rti_see(&r->lens, p, 3, 0, span)) span->lo[0] = 1, span->hi[0] = 0;
        return good;
    }
    if (rti_prim_box(geo, prim, &box, &kind)) return false;
    for (i = 0; i < 8; i++)
        for (k = 0; k < 3; k++) p[i][k] = (double)(i >> k & 1 ? box.hi[k] : box.lo[k]) - r->lens.eye[k];
#if RTI_SPHERES
    if (kind == RTI_SPHERE) {               /* a box of floats may not show a small radius far from the origin */
        const rt_sphere *ball = &geo->spheres[prim - geo->triangle_count];
        const double center[3] = { (double)ball->center.x, (double)ball->center.y, (double)ball->center.z };
        for (i = 0; i < 8; i++)
            for (k = 0; k < 3; k++) p[i][k] = center[k] - r->lens.eye[k] + (i >> k & 1 ? 1 : -1) * (double)ball->radius;
    }
#endif
    if (!(box.lo[0] <= box.hi[0])) return true;             /* an empty instance */
#if RTI_INSTANCES
    if (kind == RTI_INSTANCE) {
        size_t number = prim - geo->triangle_count - rti_sphere_count(geo);
        rti_instance *in = &r->accel.instances[number];
        rt_accel alone;                     /* with no other primitive: for its reach */
        double reach = 0, slack;
        in->prim = (uint32_t)prim;
        in->base = r->accel.instance_bases[number];
        rti_fill_instance(in, geo);
        memset(&alone, 0, sizeof alone);
        memcpy(alone.lower, box.lo, sizeof alone.lower);
        memcpy(alone.upper, box.hi, sizeof alone.upper);
        alone.node_count = alone.slots[RTI_INSTANCE] = 1;
        alone.instances = in;
        rti_set_reach(&alone);
        for (k = 0; k < 3; k++)
            if (fabs(r->lens.eye[k]) > reach) reach = fabs(r->lens.eye[k]);
        slack = (double)alone.spread * 5.9604644775390625e-08 * (reach + (double)alone.extent);
        pad = 2 * slack + rti_drift(&r->lens, slack);
    }
#endif
    if (!rti_see(&r->lens, p, 8, pad, span)) span->lo[0] = 1, span->hi[0] = 0;
    return true;
}

/* One rt_raster_create. */
typedef struct {
    rt_raster *raster;
    size_t total;
    float least[2], most[2];                /* where in its pixel a sample may lie */
    size_t *bad, *bad_count, *seen;         /* of each chunk: the first bad primitive, or total; bad ones; those that are seen */
    size_t groups, group;                   /* for counting: groups of so many primitives, */
    uint32_t *counts;                       /* each with a count a tile, and then the place of its next entry there */
    size_t tiles;
} rti_sorter;

/* Pixels with a sample in the span, in the picture. False: there are none. */
static bool rti_pixels_of(const rti_sorter *s, const rti_span *span, int first[2], int last[2])
{
    int k;
    if (span->lo[0] > span->hi[0]) return false;
    for (k = 0; k < 2; k++) {
        float lo = span->lo[k] - s->most[k], hi = span->hi[k] - s->least[k];
        int edge = k ? s->raster->height : s->raster->width;
        first[k] = lo > 0 ? (int)lo : 0;
        if ((float)first[k] < lo) first[k]++;
        last[k] = hi < 0 ? -1 : (int)hi;
        if (last[k] >= edge) last[k] = edge - 1;
        if (first[k] > last[k]) return false;
    }
    return true;
}

static void rti_see_chunk(void *context, size_t chunk)
{
    rti_sorter *s = (rti_sorter *)context;
    size_t i = chunk * RTI_CHUNK, end = s->total - i < RTI_CHUNK ? s->total : i + RTI_CHUNK, wide = s->raster->accel.geo.triangle_count;
    if (wide > end) wide = end;
    if (!s->raster->lens.narrow || s->raster->lens.blind) wide = 0;
    s->bad[chunk] = s->total;
    s->bad_count[chunk] = s->seen[chunk] = 0;
    if (wide > i) s->raster->see(s->raster, i, wide - i);
    for (; i < end; i++) {
        rti_span *span = &s->raster->spans[i];
        int first[2], last[2];
        if ((i >= wide || span->depth < 0) && !rti_span_of(s->raster, i, span) && !s->bad_count[chunk]++) s->bad[chunk] = i;
        if (rti_pixels_of(s, span, first, last)) s->seen[chunk]++;
        else span->lo[0] = 1, span->hi[0] = 0;
    }
}

/* The tiles that list a primitive: of the finest level where it meets at most 2 x 2. */
static uint32_t rti_tiles_of(const rti_sorter *s, size_t prim, uint32_t tiles[4])
{
    const rti_span *span = &s->raster->spans[prim];
    const rti_level *level = s->raster->levels;
    int first[2], last[2], x, y, shift;
    uint32_t n = 0;
    if (!rti_pixels_of(s, span, first, last)) return 0;
    for (;; level++) {
        shift = level->shift;
        if ((last[0] >> shift) - (first[0] >> shift) <= 1 && (last[1] >> shift) - (first[1] >> shift) <= 1) break;
    }
    for (y = first[1] >> shift; y <= last[1] >> shift; y++)
        for (x = first[0] >> shift; x <= last[0] >> shift; x++)
            tiles[n++] = level->first + (uint32_t)y * (uint32_t)level->columns + (uint32_t)x;
    return n;
}

static void rti_count_group(void *context, size_t group)
{
    rti_sorter *s = (rti_sorter *)context;
    uint32_t *counts = s->counts + group * s->tiles, tiles[4], n;
    size_t i = group * s->group, end = s->total - i < s->group ? s->total : i + s->group;
    memset(counts, 0, s->tiles * sizeof *counts);
    for (; i < end; i++)
        for (n = rti_tiles_of(s, i, tiles); n > 0; n--) counts[tiles[n - 1]]++;
}

static void rti_list_group(void *context, size_t group)
{
    rti_sorter *s = (rti_sorter *)context;
    uint32_t *counts = s->counts + group * s->tiles, tiles[4], n;
    size_t i = group * s->group, end = s->total - i < s->group ? s->total : i + s->group;
    for (; i < end; i++)
        for (n = rti_tiles_of(s, i, tiles); n > 0; n--) s->raster->entries[counts[tiles[n - 1]]++] = (uint32_t)i;
}

/* Levels of tiles, each of twice the side, from no more tiles than primitives that are seen up to one tile. */
static size_t rti_make_levels(rt_raster *r)
{
    size_t tiles = 0, most = r->info.seen < ((size_t)1 << 20) ? r->info.seen : (size_t)1 << 20;
    int shift = 4;
    for (;; shift++) {
        size_t columns = (((size_t)r->width - 1) >> shift) + 1, rows = (((size_t)r->height - 1) >> shift) + 1;
        rti_level *level = &r->levels[r->level_count];
        if (columns * rows > most && columns * rows > 1) continue;
        level->shift = shift;
        level->columns = (int)columns;
        level->first = (uint32_t)tiles;
        r->level_count++;
        tiles += columns * rows;
        if (columns * rows == 1) return tiles;
    }
}

static rt_status rti_raster_sort(rti_sorter *s, const rt_raster_options *opt)
{
    rt_raster *r = s->raster;
    const rt_geometry *geo = &r->accel.geo;
    void *user = opt->memory_user;
    size_t chunks = rti_chunk_total(s->total), i, g, next = 0;
    r->spans = (rti_span *)rti_alloc(s->total, sizeof(rti_span), user);
    s->bad = (size_t *)rti_alloc(chunks, 3 * sizeof(size_t), user);
    if (!r->spans || !s->bad) return RT_ERROR_MEMORY;
    s->bad_count = s->bad + chunks;
    s->seen = s->bad_count + chunks;
#if RTI_INSTANCES
    if (geo->instance_count) {
        r->accel.instances = (rti_instance *)rti_alloc(geo->instance_count, sizeof(rti_instance), user);
        if (!r->accel.instances) return RT_ERROR_MEMORY;
        r->info.bytes += geo->instance_count * sizeof(rti_instance);
    }
#endif
    rti_for(opt->parallel_for, opt->parallel_user, chunks, rti_see_chunk, s);
    for (i = 0; i < chunks; i++) {
        if (s->bad[i] < s->total && !opt->skip_invalid) return rti_bad_prim(opt->error, geo, s->bad[i]);
        r->info.skipped += s->bad_count[i];
        r->info.seen += s->seen[i];
    }
    s->tiles = rti_make_levels(r);
    s->groups = chunks < 8 ? chunks : 8;
    if (!opt->parallel_for || !chunks) s->groups = 1;
    s->group = (s->total + s->groups - 1) / s->groups;
    r->starts = (uint32_t *)rti_alloc(s->tiles + 1, sizeof(uint32_t), user);
    s->counts = (uint32_t *)rti_alloc(s->tiles, s->groups * sizeof(uint32_t), user);
    if (!r->starts || !s->counts) return RT_ERROR_MEMORY;
    rti_for(opt->parallel_for, opt->parallel_user, s->groups, rti_count_group, s);
    for (i = 0; i < s->tiles; i++) {        /* at most 4 * RT_MAX_PRIMITIVES entries: they fit in 32 bits */
        r->starts[i] = (uint32_t)next;
        for (g = 0; g < s->groups; g++) {
            uint32_t count = s->counts[g * s->tiles + i];
            s->counts[g * s->tiles + i] = (uint32_t)next;
            next += count;
        }
    }
    r->starts[i] = (uint32_t)next;
    r->entries = (uint32_t *)rti_alloc(next, sizeof(uint32_t), user);
    if (!r->entries) return RT_ERROR_MEMORY;
    rti_for(opt->parallel_for, opt->parallel_user, s->groups, rti_list_group, s);
    r->info.tiles = s->tiles;
    r->info.entries = next;
    r->info.bytes += s->total * sizeof(rti_span) + (s->tiles + 1 + next) * sizeof(uint32_t);
    return RT_OK;
}

RT_API void rt_raster_free(rt_raster *r)
{
    void *user;
    if (!r) return;
    user = r->accel.memory_user;
    rti_release(r->spans, user);
    rti_release(r->starts, user);
    rti_release(r->entries, user);
#if RTI_PLANES
    rti_release(r->accel.planes, user);
#endif
#if RTI_INSTANCES
    rti_release(r->accel.instances, user);
    rti_release(r->accel.instance_slots, user);
    rti_release(r->accel.instance_bases, user);
#endif
    rti_release(r, user);
}

/* The kernels of the widest packets, as RT_AUTO picks them. */
static rt_status rti_choose_kernels(rt_raster *r, rt_isa isa, rt_error *error)
{
    rt_trace_options trace;
    rti_batch_function batch;
    rti_job job;
    rt_status status;
    int widths[8];
    const size_t n = rti_widths(RT_AUTO, isa, widths, 8);
    memset(&trace, 0, sizeof trace);
    trace.packet_width = n ? widths[n - 1] : 0;
    trace.isa = isa;
    trace.error = error;
    if ((status = rti_choose(&r->accel, &trace, RTI_BLOCK_RAYS, &batch, &job)) != RT_OK) return status;
#define RTI_KERNELS(suffix, width) \
    if (batch == rti_batch##suffix) r->see = rti_see_triangles##suffix, r->cover = rti_cover##suffix, r->lanes = width
    RTI_KERNELS(_1, 1);
#if RTI_SINGLE_FMA
    RTI_KERNELS(_1_avx2, 1);
#endif
#if RTI_PACKETS
    RTI_KERNELS(_4, 4);
#if RTI_X86
    RTI_KERNELS(_8, 8);
#endif
#endif
#undef RTI_KERNELS
    return RT_OK;
}

/* fixed: every sample lies at the options' offset. */
static rt_status rti_raster_make(rt_raster **out, const rt_geometry *geo, const rt_camera *camera, int width, int height,
                                 const rt_raster_options *opt, bool fixed)
{
    rt_raster *r;
    rti_sorter s;
    rt_status status;
    size_t number;
    int k;
    *out = NULL;
    (void)number;
    if (!camera) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "camera is NULL");
    if (width < 1 || height < 1 || width > RTI_MAX_SIDE || height > RTI_MAX_SIDE)
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "a picture of %d x %d: each must lie between 1 and %d", width, height,
                        RTI_MAX_SIDE);
    if (!(camera->fov > 0 && camera->fov < 180))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "the camera's fov must lie between 0 and 180 degrees");
    if (!(fabsf(opt->offset_x) <= 0.5f && fabsf(opt->offset_y) <= 0.5f))
        return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "offset_x and offset_y must lie between -0.5 and 0.5");
    if ((status = rti_check_geometry(geo, opt->error)) != RT_OK) return status;

    r = (rt_raster *)rti_alloc(1, sizeof *r, opt->memory_user);
    if (!r) return rti_fail(opt->error, RT_ERROR_MEMORY, RT_NONE, "out of memory");
    memset(r, 0, sizeof *r);
    memset(&s, 0, sizeof s);
    r->accel.geo = *geo;
    r->accel.memory_user = opt->memory_user;
    r->camera = *camera;
    r->width = width;
    r->height = height;
    r->view = rti_make_view(camera, width, height);
    r->lens = rti_make_lens(&r->view, width, height);
    r->info.bytes = sizeof *r;
    s.raster = r;
    s.total = rti_tree_count(geo);
    for (k = 0; k < 2; k++) {
        s.least[k] = fixed ? 0.5f + (k ? opt->offset_y : opt->offset_x) : 0;
        s.most[k] = fixed ? s.least[k] : 1;
    }
    status = rti_choose_kernels(r, opt->isa, opt->error);
    if (status == RT_OK) status = rti_number_instances(&r->accel, geo, true, opt->error);
    r->info.bytes += r->accel.bytes;
    if (status == RT_OK) {
        status = rti_raster_sort(&s, opt);
#if RTI_PLANES
        if (status == RT_OK) {
            const size_t bytes = r->accel.bytes;
            status = rti_build_planes(&r->accel, geo, opt->skip_invalid, opt->error);
            r->info.skipped += r->accel.skipped;
            r->info.bytes += r->accel.bytes - bytes;
        }
#endif
#if RTI_INSTANCES
        for (number = 0; number < rti_instance_count(geo) && status == RT_OK; number++)     /* bad ones are not filled */
            if (geo->instances[number].accel && (geo->instances[number].motion || geo->instances[number].accel->moves)) r->accel.moves = true;
#endif
        if (status == RT_ERROR_MEMORY)
            (void)rti_fail(opt->error, status, RT_NONE, "out of memory for %lu primitives", (unsigned long)s.total);
    }
    rti_release(s.bad, opt->memory_user);
    rti_release(s.counts, opt->memory_user);
    if (status != RT_OK) rt_raster_free(r);
    else *out = r;
    return status;
}

RT_API rt_status rt_raster_create(rt_raster **out, const rt_geometry *geo, const rt_camera *camera, int width, int height,
                                  const rt_raster_options *opt)
{
    rt_raster_options defaults;
    if (!opt) {
        memset(&defaults, 0, sizeof defaults);
        opt = &defaults;
    }
    if (!out) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "out is NULL");
    return rti_raster_make(out, geo, camera, width, height, opt, false);
}

RT_API void rt_raster_get_info(const rt_raster *r, rt_raster_info *info) { *info = r->info; }

/* The hits of the pixels in box; hits points to that of its first pixel, stride leads from row to row. Blocks stand on a grid, so that each
   reads one list a level. */
static void rti_raster_rectangle(const rt_raster *r, const int box[4], float dx, float dy, rt_hit *hits, size_t stride)
{
    const int side = RTI_COVER_SIDE(r->lanes), columns = RTI_PACKET_COLUMNS(r->lanes), rows = RTI_PACKET_ROWS(r->lanes);
    rt_ray rays[RTI_BLOCK_RAYS];
    rti_block b;
    int x, y, i, row, column;
    for (i = 0; i < side * side; i++) {
        rays[i].org = r->view.eye;
        rays[i].tmin = 0;
        rays[i].tmax = RTI_INFINITY;
    }
    b.rays = rays;
    b.stride = stride;
    for (b.box[1] = box[1]; b.box[1] < box[3]; b.box[1] = b.box[3]) {
        b.box[3] = (b.box[1] & -side) + side < box[3] ? (b.box[1] & -side) + side : box[3];
        for (b.box[0] = box[0]; b.box[0] < box[2]; b.box[0] = b.box[2]) {
            rt_vec3 right[RTI_BLOCK], down[RTI_BLOCK];
            b.box[2] = (b.box[0] & -side) + side < box[2] ? (b.box[0] & -side) + side : box[2];
            b.x = (float)b.box[0] + dx;
            b.y = (float)b.box[1] + dy;
            b.hits = hits + (size_t)(b.box[1] - box[1]) * stride + (size_t)(b.box[0] - box[0]);
            for (i = 0; i < side; i++) {    /* what leaves the box repeats its last pixels: such rays are legal where those are */
                x = b.box[0] + i < b.box[2] ? b.box[0] + i : b.box[2] - 1;
                y = b.box[1] + i < b.box[3] ? b.box[1] + i : b.box[3] - 1;
                right[i] = rti_scale(r->view.right, (float)x + dx);
                down[i] = rti_scale(r->view.down, (float)y + dy);
            }
            for (i = y = 0; y < side; y += rows)
                for (x = 0; x < side; x += columns)
                    for (row = 0; row < rows; row++)
                        for (column = 0; column < columns; column++)    /* the arithmetic of rti_view_ray */
                            rays[i++].dir = rti_add(r->view.corner, rti_add(right[x + column], down[y + row]));
            r->cover(r, &b);
        }
    }
}

RT_API rt_status rt_raster_tile(const rt_raster *r, int x0, int y0, int x1, int y1, float dx, float dy, rt_hit *hits)
{
    const int box[4] = { x0, y0, x1, y1 };
    if (!r || !hits || x0 < 0 || y0 < 0 || x0 > x1 || y0 > y1 || x1 > r->width || y1 > r->height) return RT_ERROR_ARGUMENT;
    if (!(dx >= 0 && dx <= 1 && dy >= 0 && dy <= 1)) return RT_ERROR_ARGUMENT;
    rti_raster_rectangle(r, box, dx, dy, hits + (size_t)y0 * (size_t)r->width + (size_t)x0, (size_t)r->width);
    return RT_OK;
}

typedef struct { const rt_raster *raster; float dx, dy; rt_hit *hits; int columns; } rti_squares;
#define RTI_SQUARE 64                       /* pixels a side: what one call of parallel_for's body covers */

static void rti_cover_square(void *context, size_t i)
{
    const rti_squares *s = (const rti_squares *)context;
    const rt_raster *r = s->raster;
    int box[4];
    box[0] = (int)(i % (size_t)s->columns) * RTI_SQUARE;
    box[1] = (int)(i / (size_t)s->columns) * RTI_SQUARE;
    box[2] = box[0] + RTI_SQUARE < r->width ? box[0] + RTI_SQUARE : r->width;
    box[3] = box[1] + RTI_SQUARE < r->height ? box[1] + RTI_SQUARE : r->height;
    rti_raster_rectangle(r, box, s->dx, s->dy, s->hits + (size_t)box[1] * (size_t)r->width + (size_t)box[0], (size_t)r->width);
}

RT_API rt_status rt_rasterize(const rt_geometry *geo, const rt_camera *camera, int width, int height, const rt_raster_options *opt,
                              rt_hit *hits)
{
    rt_raster_options defaults;
    rt_raster *r;
    rt_status status;
    rti_squares s;
    if (!opt) {
        memset(&defaults, 0, sizeof defaults);
        opt = &defaults;
    }
    if (!hits) return rti_fail(opt->error, RT_ERROR_ARGUMENT, RT_NONE, "hits is NULL");
    if ((status = rti_raster_make(&r, geo, camera, width, height, opt, true)) != RT_OK) return status;
    s.raster = r;
    s.dx = 0.5f + opt->offset_x;
    s.dy = 0.5f + opt->offset_y;
    s.hits = hits;
    s.columns = (width + RTI_SQUARE - 1) / RTI_SQUARE;
    rti_for(opt->parallel_for, opt->parallel_user, (size_t)s.columns * (size_t)((height + RTI_SQUARE - 1) / RTI_SQUARE), rti_cover_square,
            &s);
    rt_raster_free(r);
    return RT_OK;
}

/* Made for this picture of so many primitives? */
static bool rti_raster_fits(const rt_raster *r, const rt_geometry *geo, const rt_camera *camera, int width, int height)
{
    return r->width == width && r->height == height && memcmp(&r->camera, camera, sizeof *camera) == 0 &&
           r->accel.geo.triangle_count == geo->triangle_count && rti_sphere_count(&r->accel.geo) == rti_sphere_count(geo) &&
           rti_instance_count(&r->accel.geo) == rti_instance_count(geo);
}

/* ---- >>texture ------------------------------------------------------------------------------------------------------ */

/* A scene, as what an instance shows is shaded. */
typedef rt_scene rti_part;

RT_API size_t rt_count_texture_levels(int width, int height)
{
    size_t count = 0;
    if (width < 1 || height < 1 || width > 1 << 14 || height > 1 << 14) return 0;
    for (;;) {
        count += (size_t)width * (size_t)height;
        if (width == 1 && height == 1) return count;
        width = width > 1 ? width / 2 : 1;
        height = height > 1 ? height / 2 : 1;
    }
}

/* The mean of what texel (x, y) of a level stands for in the level above: of odd sizes parts of texels too. */
static rt_vec3 rti_shrink(const rt_vec3 *from, int width, int height, int x, int y, int to_width, int to_height)
{
    const float left = (float)x * (float)width / (float)to_width, right = (float)(x + 1) * (float)width / (float)to_width;
    const float top = (float)y * (float)height / (float)to_height, bottom = (float)(y + 1) * (float)height / (float)to_height;
    rt_vec3 sum = rti_vec3(0, 0, 0);
    float weights = 0;
    int i, j;
    for (j = (int)top; j < height && (float)j < bottom; j++)
        for (i = (int)left; i < width && (float)i < right; i++) {
            const float across = ((float)(i + 1) < right ? (float)(i + 1) : right) - ((float)i > left ? (float)i : left);
            const float down = ((float)(j + 1) < bottom ? (float)(j + 1) : bottom) - ((float)j > top ? (float)j : top);
            const float weight = rti_keepf(across * down);
            sum = rti_add(sum, rti_scale(from[(size_t)j * (size_t)width + (size_t)i], weight));
            weights += weight;
        }
    return rti_scale(sum, 1 / weights);
}

RT_API void rt_make_texture_levels(const rt_vec3 *pixels, int width, int height, rt_vec3 *levels)
{
    int x, y;
    memcpy(levels, pixels, (size_t)width * (size_t)height * sizeof *levels);
    while (width > 1 || height > 1) {
        const int half = width > 1 ? width / 2 : 1, low = height > 1 ? height / 2 : 1;
        rt_vec3 *to = levels + (size_t)width * (size_t)height;
        for (y = 0; y < low; y++)
            for (x = 0; x < half; x++) to[(size_t)y * (size_t)half + (size_t)x] = rti_shrink(levels, width, height, x, y, half, low);
        levels = to;
        width = half;
        height = low;
    }
}

#endif
#endif
#if RTI_IN(SHADING) && !defined(RT_NO_SHADING)
/* What a pixel sees of a surface is about an ellipse; a texture's mean over it is what is asked for. It comes in texture coordinates, or,
   of solid textures, in space: its middle, and its axes, from edge to edge. */
RTI_SHARED(
typedef struct { float at[3], axes[2][3]; } rti_spot;       /* axes at right angles, the first the long one; of an image in texels, at in 1 */
)

/* x modulo 1, below it also for negative and huge x. */
RTI_SHARED(
static float rti_wrap(float x)
{
    const float part = x - floorf(x);
    return part >= 0 && part < 1 ? part : 0;
}
)

RTI_SHARED(
static rt_vec3 rti_mix(rt_vec3 a, rt_vec3 b, float part) { return rti_add(rti_scale(a, 1 - part), rti_scale(b, part)); }
)

/* Between the four nearest texels of a level, which repeats. */
RTI_SHARED(
static rt_vec3 rti_texel(const RTI_GLOBAL rt_vec3 *level, int width, int height, float u, float v)
{
    const float x = rti_keepf(rti_wrap(u) * (float)width) - 0.5f, y = rti_keepf(rti_wrap(-v) * (float)height) - 0.5f;
    const int left = (int)floorf(x), top = (int)floorf(y);
    const size_t x0 = (size_t)((left + width) % width), x1 = (size_t)((left + 1 + width) % width);
    const size_t y0 = (size_t)((top + height) % height) * (size_t)width, y1 = (size_t)((top + 1 + height) % height) * (size_t)width;
    return rti_mix(rti_mix(level[y0 + x0], level[y0 + x1], x - (float)left), rti_mix(level[y1 + x0], level[y1 + x1], x - (float)left),
                   y - (float)top);
}
)

/* From the two levels whose texels are nearest to a width, which is in those of the first. */
RTI_SHARED(
static rt_vec3 rti_image(const RTI_GLOBAL rt_texture *texture, const float at[2], float texels)
{
    const RTI_GLOBAL rt_vec3 *level = RTI_FOLLOW(rt_vec3, texture, levels);
    int width = texture->width, height = texture->height;
    float part;
    while (texels > 2 && (width > 1 || height > 1)) {
        level += (size_t)width * (size_t)height;
        width = width > 1 ? width / 2 : 1;
        height = height > 1 ? height / 2 : 1;
        texels /= 2;
    }
    part = texels - 1;
    if (!(part > 0) || (width == 1 && height == 1)) return rti_texel(level, width, height, at[0], at[1]);
    return rti_mix(rti_texel(level, width, height, at[0], at[1]),
                   rti_texel(level + (size_t)width * (size_t)height, width > 1 ? width / 2 : 1, height > 1 ? height / 2 : 1, at[0], at[1]),
                   part < 1 ? part : 1);
}
)

/* The integral from 0 of what is 1 in even fields and -1 in odd ones. */
RTI_SHARED(
static float rti_fields(float x) { return 1 - fabsf(2 * rti_wrap(0.5f * x) - 1); }
)

/* The mean of that over a box around at. */
RTI_SHARED(
static float rti_field_mean(float at, float width)
{
    if (!(width > 1e-3f)) return rti_wrap(0.5f * at) < 0.5f ? 1.0f : -1.0f;
    if (width > 1e6f) return 0;
    at = 2 * rti_wrap(0.5f * at);           /* first: the difference of two large numbers would be noise */
    return (rti_fields(at + 0.5f * width) - rti_fields(at - 0.5f * width)) / width;
}
)

/* The gradient at a lattice point, one of 12 (Perlin 2002), times the way from it. */
RTI_SHARED(
RTI_INLINE float rti_lattice(const int cell[3], int corner, const float off[3])
{
    const uint32_t x_hash = (uint32_t)(cell[0] + (corner & 1)) * 0x8da6b343u, y_hash = (uint32_t)(cell[1] + (corner >> 1 & 1)) * 0xd8163841u;
    const uint32_t hash = rti_hash(x_hash ^ y_hash ^ (uint32_t)(cell[2] + (corner >> 2)) * 0xcb1ab31fu);
    const float x = off[0] - (float)(corner & 1), y = off[1] - (float)(corner >> 1 & 1), z = off[2] - (float)(corner >> 2);
    const uint32_t pair = (hash >> 8) % 3;
    const float a = pair == 0 ? x : y, b = pair == 2 ? x : z;       /* xz, yz, yx */
    return (hash & 1 ? a : -a) + (hash & 2 ? b : -b);
}
)

RTI_SHARED(
static float rti_gradient_noise(const float at[3])
{
    float off[3], fade[3], sum[4];
    int cell[3], i, k;
    for (k = 0; k < 3; k++) {
        const float low = floorf(at[k]);
        off[k] = at[k] - low;
        if (!(fabsf(low) < 1e9f)) return 0;         /* no lattice that far out */
        cell[k] = (int)low;
        fade[k] = off[k] * off[k] * off[k] * (rti_keepf(off[k] * (rti_keepf(off[k] * 6) - 15)) + 10);
    }
    for (i = 0; i < 4; i++) {
        const float a = rti_lattice(cell, 2 * i, off), b = rti_lattice(cell, 2 * i + 1, off);
        sum[i] = a + rti_keepf((b - a) * fade[0]);
    }
    sum[0] += rti_keepf((sum[1] - sum[0]) * fade[1]);
    sum[2] += rti_keepf((sum[3] - sum[2]) * fade[1]);
    return sum[0] + rti_keepf((sum[2] - sum[0]) * fade[2]);
}
)

/* Waves, each half as long and high as the last: 0 to 1, 0.5 on average. Those shorter than two widths fade out. */
RTI_SHARED(
static float rti_noise(const float at[3], float width)
{
    float x[3] = { at[0], at[1], at[2] }, sum = 0, height = 0.55f;
    int octave, k;
    for (octave = 0; octave < 7; octave++) {
        const float show = 2 - 2 * width;
        if (!(show > 0)) break;
        sum += rti_keepf(height * (show < 1 ? show : 1) * rti_gradient_noise(x));
        for (k = 0; k < 3; k++) x[k] = 2 * x[k] + 7.3f;     /* so that the lattices do not share their zeros */
        width *= 2;
        height *= 0.5f;
    }
    sum = 0.5f + 0.5f * sum;
    return sum < 0 ? 0 : sum > 1 ? 1 : sum;
}
)

RTI_SHARED(
static float rti_length3(const float a[3]) { return sqrtf(rti_keepf(a[0] * a[0]) + rti_keepf(a[1] * a[1]) + rti_keepf(a[2] * a[2])); }
)

RTI_SHARED(
enum { RTI_TAPS = 12 };                     /* along the long axis: further apart than the short one is wide, they blur */
)

/* The texture's mean over a spot. */
RTI_SHARED(
static rt_vec3 rti_look_at_texture(const RTI_GLOBAL rt_texture *texture, const rti_spot *spot)
{
    const float size = texture->size > 0 ? texture->size : 1;
    const bool plain = texture->colors[0].x == 0 && texture->colors[0].y == 0 && texture->colors[0].z == 0 && texture->colors[1].x == 0 &&
                       texture->colors[1].y == 0 && texture->colors[1].z == 0;
    const rt_vec3 low = texture->colors[0], high = plain ? rti_vec3(1, 1, 1) : texture->colors[1];
    const float wide = rti_length3(spot->axes[0]), narrow = rti_length3(spot->axes[1]);
    const bool image = texture->kind == RT_TEXTURE_IMAGE;
    const float scale[3] = { image ? (float)texture->width : 1, image ? (float)texture->height : 1, 1 };
    rt_vec3 sum = rti_vec3(0, 0, 0);
    float at[3], width;
    int taps, i, k;
    taps = wide < (float)RTI_TAPS * narrow ? (int)(wide / narrow + 0.5f) : wide > 0 ? RTI_TAPS : 1;
    width = rti_maxf(narrow, wide / (float)taps);
    for (i = 0; i < taps; i++) {
        const float along = ((float)i + 0.5f) / (float)taps - 0.5f;
        for (k = 0; k < 3; k++) at[k] = spot->at[k] + rti_keepf(along * spot->axes[0][k]) / scale[k];
        if (image) sum = rti_add(sum, rti_image(texture, at, width));
        else if (texture->kind == RT_TEXTURE_CHECKER) {     /* exactly, of a box around a piece of the long axis */
            float mean = 1;
            for (k = 0; k < (texture->solid ? 3 : 2); k++)
                mean *= rti_field_mean(at[k] / size, (fabsf(spot->axes[0][k]) / (float)taps + fabsf(spot->axes[1][k])) / size);
            sum = rti_add(sum, rti_mix(low, high, 0.5f - 0.5f * mean));
        } else {
            for (k = 0; k < 3; k++) at[k] = !texture->solid && k == 2 ? 0 : at[k] / size;
            sum = rti_add(sum, rti_mix(low, high, rti_noise(at, width / size)));
        }
    }
    return rti_scale(sum, 1 / (float)taps);
}
)

/* How steps on a surface are steps of its texture coordinates: du = step . across[0], dv = step . across[1]; where it is at now. */
RTI_SHARED(
typedef struct { float u, v; rt_vec3 across[2]; } rti_mapping;
)

/* What shades the primitives of a geometry: as rt_scene and rt_geometry say, but for the strides, which count floats. */
RTI_SHARED(
typedef struct {
    const RTI_GLOBAL float *vertices;
    size_t stride;
    const RTI_GLOBAL uint32_t *indices;
    const RTI_GLOBAL rt_vec3 *normals;
    const RTI_GLOBAL uint32_t *normal_indices;
    const RTI_GLOBAL rt_vec3 *colors;
    const RTI_GLOBAL float *texcoords;
    const RTI_GLOBAL uint32_t *texcoord_indices;
    const RTI_GLOBAL rt_material *materials;        /* never NULL */
    const RTI_GLOBAL uint32_t *material_ids;
    uint32_t triangle_count, instance_count, tree_count;    /* tree_count: what rti_tree_count says */
)
#if RTI_SPHERES
RTI_SHARED(
    const RTI_GLOBAL rt_sphere *spheres;
)
#endif
#if RTI_PLANES
RTI_SHARED(
    const RTI_GLOBAL rt_plane *planes;
)
#endif
RTI_SHARED(
} rti_shape;
)

/* Of a triangle with corners p, p + a, p + b. */
RTI_SHARED(
static rti_mapping rti_map_triangle(const rti_shape *shape, const rt_hit *hit, rt_vec3 a, rt_vec3 b)
{
    const float aa = rti_dot(a, a), ab = rti_dot(a, b), bb = rti_dot(b, b), det = rti_minor(aa, bb, ab, ab);
    float corner[3][2] = { { 0, 0 }, { 1, 0 }, { 0, 1 } }, at[2];
    rt_vec3 to_a = rti_vec3(0, 0, 0), to_b = to_a;          /* a step's parts along a and b */
    rti_mapping m;
    int i, k;
    if (shape->texcoords) {
        const RTI_GLOBAL uint32_t *index = shape->texcoord_indices + 3 * (size_t)hit->prim;
        if (index[0] != RT_NONE)
            for (i = 0; i < 3; i++)
                for (k = 0; k < 2; k++) corner[i][k] = shape->texcoords[2 * (size_t)index[i] + (size_t)k];
    }
    if (det > 0) {
        to_a = rti_scale(rti_sub(rti_scale(a, bb), rti_scale(b, ab)), 1 / det);
        to_b = rti_scale(rti_sub(rti_scale(b, aa), rti_scale(a, ab)), 1 / det);
    }
    for (k = 0; k < 2; k++) {
        const float along_a = corner[1][k] - corner[0][k], along_b = corner[2][k] - corner[0][k];
        at[k] = corner[0][k] + rti_keepf(hit->u * along_a) + rti_keepf(hit->v * along_b);
        m.across[k] = rti_add(rti_scale(to_a, along_a), rti_scale(to_b, along_b));
    }
    m.u = at[0];
    m.v = at[1];
    return m;
}
)

/* Of a sphere, out being from its centre: longitude, 0.5 at +x and growing towards +z, and latitude from -y. Near the poles a step may go
   round: that is as far as it counts. */
RTI_SHARED(
static rti_mapping rti_map_sphere(rt_vec3 out)
{
    const float level2 = rti_keepf(out.x * out.x) + rti_keepf(out.z * out.z), r2 = level2 + rti_keepf(out.y * out.y), level = sqrtf(level2);
    const rt_vec3 east = level > 0 ? rti_vec3(-out.z / level, 0, out.x / level) : rti_vec3(1, 0, 0);
    const rt_vec3 north = level > 0 ? rti_vec3(-out.x * out.y / level, level, -out.z * out.y / level) : rti_vec3(0, 0, 1);
    rti_mapping m;
    m.u = 0.5f + rti_keepf(rti_atan2f(out.z, out.x) * 0.159154943f);
    m.v = 0.5f + rti_keepf(rti_atan2f(out.y, level) * 0.318309886f);
    m.across[0] = rti_scale(east, 0.159154943f / rti_maxf(level, 1e-4f * sqrtf(r2)));
    m.across[1] = rti_scale(north, r2 > 0 ? 0.318309886f / r2 : 0);
    return m;
}
)

#if RTI_PLANES
RTI_SHARED(
static rti_mapping rti_map_plane(rt_vec3 normal, rt_vec3 from)
{
    rti_mapping m;
    rti_frame(rti_normalize(normal), &m.across[0], &m.across[1]);
    m.u = rti_dot(from, m.across[0]);
    m.v = rti_dot(from, m.across[1]);
    return m;
}
)
#endif

/* Two half axes of an ellipse, of which each is parallel to the tangents where the other ends, become its own axes, at right angles, the first the
   long one: what an affine map makes of the axes of an ellipse are the former. */
RTI_SHARED(
static void rti_turn_axes(rt_vec3 axes[2])
{
    const rt_vec3 a = axes[0], b = axes[1];
    const float aa = rti_dot(a, a), ab = rti_dot(a, b), bb = rti_dot(b, b), most = rti_maxf(aa, bb);
    float rest, twist, length, cosine, sine;
    if (!(most > 0 && most <= FLT_MAX)) return;
    rest = (aa - bb) / most;
    twist = 2 * ab / most;
    length = sqrtf(rti_keepf(rest * rest) + rti_keepf(twist * twist));
    if (!(length > 0)) return;              /* a circle */
    cosine = sqrtf(rti_maxf(0.5f + 0.5f * rest / length, 0));
    sine = copysignf(sqrtf(rti_maxf(0.5f - 0.5f * rest / length, 0)), twist);
    axes[0] = rti_add(rti_scale(a, cosine), rti_scale(b, sine));
    axes[1] = rti_sub(rti_scale(b, cosine), rti_scale(a, sine));
}
)

/* The spot around what is seen, steps being the axes of what is seen on the surface. */
RTI_SHARED(
static rti_spot rti_spot_of(const RTI_GLOBAL rt_texture *texture, const rti_mapping *m, rt_vec3 point, const rt_vec3 steps[2])
{
    const bool image = texture->kind == RT_TEXTURE_IMAGE;
    const float width = image ? (float)texture->width : 1, height = image ? (float)texture->height : 1;
    rt_vec3 axes[2];
    rti_spot spot;
    int i;
    for (i = 0; i < 2; i++)
        axes[i] = texture->solid ? steps[i] : rti_vec3(rti_dot(steps[i], m->across[0]) * width, rti_dot(steps[i], m->across[1]) * height, 0);
    rti_turn_axes(axes);
    spot.at[0] = texture->solid ? point.x : m->u;
    spot.at[1] = texture->solid ? point.y : m->v;
    spot.at[2] = texture->solid ? point.z : 0;
    for (i = 0; i < 2; i++) {
        spot.axes[i][0] = axes[i].x;
        spot.axes[i][1] = axes[i].y;
        spot.axes[i][2] = axes[i].z;
    }
    return spot;
}
)

RTI_SHARED(
static float rti_height_at(const RTI_GLOBAL rt_texture *texture, const rti_mapping *m, rt_vec3 point, const rt_vec3 round[2], rt_vec3 step)
{
    rti_mapping there = *m;
    rti_spot spot;
    rt_vec3 color;
    there.u += rti_dot(step, m->across[0]);
    there.v += rti_dot(step, m->across[1]);
    spot = rti_spot_of(texture, &there, rti_add(point, step), round);
    color = rti_look_at_texture(texture, &spot);
    return rti_keepf((color.x + color.y + color.z) * 0.333333333f);
}
)

/* Blinn 1978: the normal, of unit length, of a surface raised by a texture's height: by its slopes along the axes of what is seen, over no
   less than those, so that waves too short to be seen do not tilt it; and no less than a texel or a small part of a wave. */
RTI_SHARED(
static rt_vec3 rti_bump(const RTI_GLOBAL rt_material *material, const rti_mapping *m, rt_vec3 point, rt_vec3 normal, const rt_vec3 steps[2])
{
    const RTI_GLOBAL rt_texture *texture = RTI_FOLLOW(rt_texture, material, bump);
    const float size = texture->size > 0 ? texture->size : 1;
    const float most = (float)(texture->width > texture->height ? texture->width : texture->height);
    const float least = texture->kind == RT_TEXTURE_IMAGE ? 0.5f / most : size / 32;
    const float long2 = rti_dot(steps[0], steps[0]), short2 = rti_dot(steps[1], steps[1]);
    rt_vec3 bumped = normal, round[2];      /* where the axes differ much, a circle between them: one look at the texture, not many */
    int i;
    round[0] = rti_scale(rti_normalize(steps[0]), sqrtf(sqrtf(long2 * short2)));
    round[1] = rti_scale(rti_normalize(steps[1]), sqrtf(sqrtf(long2 * short2)));
    for (i = 0; i < 2; i++) {
        const float length = sqrtf(rti_dot(steps[i], steps[i]));
        const rt_vec3 along = rti_normalize(steps[i]);
        const float du = rti_dot(along, m->across[0]), dv = rti_dot(along, m->across[1]);
        const float rate = texture->solid ? 1 : sqrtf(rti_keepf(du * du) + rti_keepf(dv * dv));
        const float step = rti_maxf(length, rate > 0 ? least / rate : 0);
        rt_vec3 way;
        float slope;
        if (!(step > 0)) continue;
        way = rti_scale(along, 0.5f * step);
        slope = (rti_height_at(texture, m, point, round, way) - rti_height_at(texture, m, point, round, rti_scale(way, -1))) / step;
        bumped = rti_sub(bumped, rti_scale(along, slope * material->bump_height));
    }
    return rti_normalize(bumped);
}
)

#endif
#if RTI_IN(HOST)

/* ---- >>shading ------------------------------------------------------------------------------------------------------ */

/* One ray: how it starts, what it meets, what lights do there, and what it sends on. */

#ifndef RT_NO_SHADING
static const rt_material rti_grey = {       /* of scenes without materials */
    { 0.7f, 0.7f, 0.7f }, { 0, 0, 0 }, { 0, 0, 0 }, 1, { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 }, 1, false,
#if RTI_SAMPLING
    0,
#endif
    NULL, NULL, 0
};

static rti_shape rti_shape_of(const rt_scene *scene)
{
    const rt_geometry *geo = scene->geometry;
    rti_shape shape;
    shape.vertices = geo->vertices;
    shape.stride = geo->vertex_stride ? geo->vertex_stride / sizeof(float) : 3;
    shape.indices = geo->indices;
    shape.normals = scene->normals;
    shape.normal_indices = scene->normal_indices;
    shape.colors = scene->colors;
    shape.texcoords = scene->texcoords;
    shape.texcoord_indices = scene->texcoord_indices;
    shape.materials = scene->material_count ? scene->materials : &rti_grey;
    shape.material_ids = scene->material_count ? scene->material_ids : NULL;
    shape.triangle_count = (uint32_t)geo->triangle_count;
    shape.instance_count = (uint32_t)rti_instance_count(geo);
    shape.tree_count = (uint32_t)rti_tree_count(geo);
#if RTI_SPHERES
    shape.spheres = geo->spheres;
#endif
#if RTI_PLANES
    shape.planes = geo->planes;
#endif
    return shape;
}

#if RTI_INSTANCES
static const rti_part *rti_part_of(const rti_part *part, uint32_t number)
{
    RT_ASSERT(part->parts && part->parts[number] && part->parts[number]->accel && part->parts[number]->geometry);
    return part->parts[number];
}
#endif
#if RTI_SAMPLING
#define RTI_SAMPLING_OR(with, without) (with)
#else
#define RTI_SAMPLING_OR(with, without) (without)
#endif
#endif
#endif
#if RTI_IN(SHADING) && !defined(RT_NO_SHADING)

/* What a ray carries besides itself. */
RTI_SHARED(
typedef struct {
    rt_vec3 weight;                         /* of what it sees, in its pixel */
    uint32_t pixel;                         /* of the block: y * side + x */
    const RTI_GLOBAL rt_material *medium;   /* inside of which it runs, or NULL */
    float width;                            /* of what its pixel sees, where it starts: grows as if all that mirrors or refracts were flat */
)
#if RTI_SAMPLING
RTI_SHARED(
    float time;
    uint32_t branch;                        /* of the sample's tree of rays: the eye ray 1, what it sees mirrored 2, refracted 3, and so on */
)
#endif
RTI_SHARED(
} rti_path;
typedef enum { RTI_EYE, RTI_REFLECT, RTI_REFRACT } rti_kind_of_ray;
)

/* How the rays of a sample start, and where their numbers come from. */
RTI_SHARED(
typedef struct {
    rti_view view;
    uint32_t left, top, side;               /* of the block, in pixels */
)
#if RTI_SAMPLING
RTI_SHARED(
    rt_sampler sampler;
    uint32_t sample;                        /* of each pixel, that is being drawn */
    rt_filter filter;
    rti_aperture lens;
    bool spread;                            /* samples lie anywhere in the filter, not regularly in the pixel */
    bool timed;                             /* rays have times that matter, from open, for length */
    float open, length;
    uint32_t light_pairs;                   /* of numbers, for lights, see rti_draw */
)
#endif
RTI_SHARED(
} rti_film;
)

/* What rays meet. */
RTI_SHARED(
typedef struct {
    rti_shape shape;                        /* what is in no instance */
    rt_vec3 ambient, background;
    float angle;                            /* that a sample stands for: by so much a ray's width grows a unit of length */
)
#if RTI_INSTANCES
RTI_SHARED(
    const rt_accel *accel;
    const RTI_GLOBAL rti_part *part;        /* the outermost */
)
#endif
RTI_SHARED(
} rti_world;
)

/* The mean of three vectors by the weights of a hit; in one expression a component, which the compiler keeps in registers. */
RTI_SHARED(
RTI_INLINE rt_vec3 rti_blend(const rt_hit *hit, rt_vec3 a, rt_vec3 b, rt_vec3 c)
{
    const float u = hit->u, v = hit->v, w = 1 - u - v;
    return rti_vec3(rti_keepf(a.x * w) + rti_keepf(b.x * u) + rti_keepf(c.x * v),
                    rti_keepf(a.y * w) + rti_keepf(b.y * u) + rti_keepf(c.y * v),
                    rti_keepf(a.z * w) + rti_keepf(b.z * u) + rti_keepf(c.z * v));
}
)

RTI_SHARED(
RTI_INLINE void rti_put(float *lanes, int lane, rt_vec3 v)
{
    lanes[lane * RTI_ABREAST] = v.x;
    lanes[(lane + 1) * RTI_ABREAST] = v.y;
    lanes[(lane + 2) * RTI_ABREAST] = v.z;
}

RTI_INLINE rt_vec3 rti_get(const float *lanes, int lane)
{
    return rti_vec3(lanes[lane * RTI_ABREAST], lanes[(lane + 1) * RTI_ABREAST], lanes[(lane + 2) * RTI_ABREAST]);
}
)

/* How a surface is looked at. */
RTI_SHARED(
typedef struct {
    rt_vec3 dir;                            /* of the ray, in the world, of any length */
    float width;                            /* of what the pixel sees, across it */
    float stretch;                          /* how much longer a length of the primitive's space may be in the world */
    const float *inverse;                   /* from the world to there; NULL: the same */
} rti_gaze;

static rt_vec3 rti_row(const float *m) { return rti_vec3(m[0], m[1], m[2]); }

static rt_vec3 rti_turn_inside(const rti_gaze *gaze, rt_vec3 a)
{
    const float *m = gaze->inverse;
    return m ? rti_vec3(rti_dot(rti_row(m), a), rti_dot(rti_row(m + 4), a), rti_dot(rti_row(m + 8), a)) : a;
}
)

/* Which vertices a triangle has, and its edges from the first. */
RTI_SHARED(
RTI_INLINE void rti_edges_of(const rti_shape *shape, uint32_t prim, size_t corners[3], rt_vec3 *pq, rt_vec3 *pr)
{
    const size_t first = 3 * (size_t)prim;
    const RTI_GLOBAL uint32_t *v = shape->indices ? shape->indices + first : NULL;
    const RTI_GLOBAL float *p, *q, *r;
    corners[0] = v ? v[0] : first;
    corners[1] = v ? v[1] : first + 1;
    corners[2] = v ? v[2] : first + 2;
    p = shape->vertices + corners[0] * shape->stride;
    q = shape->vertices + corners[1] * shape->stride;
    r = shape->vertices + corners[2] * shape->stride;
    *pq = rti_vec3(q[0] - p[0], q[1] - p[1], q[2] - p[2]);
    *pr = rti_vec3(r[0] - p[0], r[1] - p[1], r[2] - p[2]);
}
)

/* Textures: multiplies tint, and tilts the shading normal. What is seen of the surface is the section of the ray's cone with it. */
RTI_SHARED(
RTI_NOINLINE void rti_wear(const rti_shape *shape, const rt_hit *hit, const RTI_GLOBAL rt_material *material, rt_vec3 point,
                           const rti_gaze *gaze, float *lanes, rt_vec3 *tint)
{
    const rt_vec3 dir = rti_normalize(rti_turn_inside(gaze, gaze->dir)), normal = rti_normalize(rti_get(lanes, RTI_NORMAL));
    const float cosine = rti_dot(dir, normal), depth = copysignf(rti_maxf(fabsf(cosine), 0.01f), cosine);
    rt_vec3 steps[2];
    rti_mapping m;
    int i;
    rti_frame(rti_normalize(gaze->dir), &steps[0], &steps[1]);
    for (i = 0; i < 2; i++) {               /* along the ray onto the surface */
        const rt_vec3 across = rti_scale(rti_turn_inside(gaze, steps[i]), gaze->width);
        const float high = rti_dot(across, normal);
        steps[i] = rti_sub(rti_sub(across, rti_scale(normal, high)), rti_scale(rti_sub(dir, rti_scale(normal, cosine)), high / depth));
    }
    rti_turn_axes(steps);
    if (!RTI_SHOWS(SHAPES) || hit->prim < shape->triangle_count) {
        size_t corners[3];
        rt_vec3 pq, pr;
        rti_edges_of(shape, hit->prim, corners, &pq, &pr);
        m = rti_map_triangle(shape, hit, pq, pr);
    }
)
#if RTI_PLANES
RTI_SHARED(
    else if (hit->prim >= shape->tree_count) {
        const rt_plane plane = shape->planes[hit->prim - shape->tree_count];
        m = rti_map_plane(plane.normal, rti_sub(point, plane.point));
    }
)
#endif
RTI_SHARED(
    else m = rti_map_sphere(rti_get(lanes, RTI_GEOMETRIC));
    if (material->texture) {
        const RTI_GLOBAL rt_texture *texture = RTI_FOLLOW(rt_texture, material, texture);
        const rti_spot spot = rti_spot_of(texture, &m, point, steps);
        *tint = rti_mul(*tint, rti_look_at_texture(texture, &spot));
    }
    if (material->bump && material->bump_height != 0) rti_put(lanes, RTI_NORMAL, rti_bump(material, &m, point, normal, steps));
}
)

/* Writes a surface's normals, of any length, and multiplies tint by its colours; answers its material. Of a hit on a
   primitive of shape itself, in its space. */
RTI_SHARED(
RTI_INLINE const RTI_GLOBAL rt_material *rti_look_up(const rti_shape *shape, const rt_hit *hit, rt_vec3 point, const rti_gaze *gaze,
                                                     float *lanes, rt_vec3 *tint)
{
    const RTI_GLOBAL rt_material *material;
    uint32_t id = hit->prim;                /* in material_ids, where instances have no place */
    if (!RTI_SHOWS(SHAPES) || hit->prim < shape->triangle_count) {
        size_t v[3];
        rt_vec3 pq, pr, flat;
        rti_edges_of(shape, hit->prim, v, &pq, &pr);
        flat = rti_cross(pq, pr);
        /* t errs by so much too */
        lanes[RTI_OFFSET * RTI_ABREAST] += rti_keepf(0.1f * gaze->stretch * rti_maxf(rti_largest(pq), rti_largest(pr)));
        rti_put(lanes, RTI_GEOMETRIC, flat);
        rti_put(lanes, RTI_NORMAL, flat);
        if (shape->normals) {
            const RTI_GLOBAL uint32_t *n = shape->normal_indices + 3 * (size_t)hit->prim;
            if (n[0] != RT_NONE) {
                const rt_vec3 smooth = rti_blend(hit, shape->normals[n[0]], shape->normals[n[1]], shape->normals[n[2]]);
                if (smooth.x != 0 || smooth.y != 0 || smooth.z != 0) rti_put(lanes, RTI_NORMAL, smooth);
            }
        }
        if (shape->colors) *tint = rti_mul(*tint, rti_blend(hit, shape->colors[v[0]], shape->colors[v[1]], shape->colors[v[2]]));
    }
)
#if RTI_PLANES
RTI_SHARED(
    else if (hit->prim >= shape->tree_count) {
        const rt_vec3 normal = shape->planes[hit->prim - shape->tree_count].normal;
        rti_put(lanes, RTI_GEOMETRIC, normal);
        rti_put(lanes, RTI_NORMAL, normal);
        id -= shape->instance_count;
    }
)
#endif
#if RTI_SPHERES
RTI_SHARED(
    else {
        const rt_vec3 out = rti_sub(point, shape->spheres[hit->prim - shape->triangle_count].center);
        rti_put(lanes, RTI_GEOMETRIC, out);
        rti_put(lanes, RTI_NORMAL, out);
    }
)
#endif
RTI_SHARED(
    material = &shape->materials[shape->material_ids ? shape->material_ids[id] : 0];
    if (RTI_SHOWS(TEXTURES) && RTI_UNLIKELY(material->texture || material->bump)) rti_wear(shape, hit, material, point, gaze, lanes, tint);
    return material;
}
)

#if RTI_INSTANCES
/* By the transpose of inverse; of unit length. */
RTI_SHARED(
static rt_vec3 rti_world_normal(const float inverse[12], rt_vec3 n)
{
    return rti_normalize(rti_add(rti_add(rti_scale(rti_row(inverse), n.x), rti_scale(rti_row(inverse + 4), n.y)),
                                 rti_scale(rti_row(inverse + 8), n.z)));
}
)

/* The same of a hit within an instance, which may move: at a time. */
RTI_SHARED(
RTI_NOINLINE const RTI_GLOBAL rt_material *rti_look_into(const rti_world *world, const rt_hit *hit, rt_vec3 at, float time,
                                                         const rti_gaze *gaze, float *lanes, rt_vec3 *tint)
{
    const RTI_GLOBAL rt_material *material;
    const RTI_GLOBAL rti_part *part = world->part;
    rti_family family = rti_family_of(world->accel);
    uint32_t inst = hit->inst;
    double to_world[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    float m[12], inverse[12], org[3], dir[3];
    const float point[3] = { at.x, at.y, at.z };
    rti_gaze inside = *gaze;
    rti_shape shape;
    int i;
    while (inst != RT_NONE) part = rti_part_of(part, rti_descend(world->accel, &family, &inst, time, to_world));
    for (i = 0; i < 12; i++) m[i] = (float)to_world[i];
    (void)rti_invert(m, inverse);
    rti_transform_ray(inverse, point, point, org, dir);
    inside.stretch = (float)rti_stretch(m);
    inside.inverse = inverse;
    shape = rti_shape_of(part);
    material = rti_look_up(&shape, hit, rti_row(org), &inside, lanes, tint);
    rti_put(lanes, RTI_GEOMETRIC, rti_world_normal(inverse, rti_get(lanes, RTI_GEOMETRIC)));
    rti_put(lanes, RTI_NORMAL, rti_world_normal(inverse, rti_get(lanes, RTI_NORMAL)));
    return material;
}
)
#endif

RTI_SHARED(
static void rti_add_to(rt_vec3 *sum, rt_vec3 a, rt_vec3 b) { *sum = rti_add(*sum, rti_mul(a, b)); }

static bool rti_any(rt_vec3 a) { return a.x > 0 || a.y > 0 || a.z > 0; }

static bool rti_shows(rt_vec3 weight)      /* more than half a step of a picture with 256 of them; false for NaN */
{
    const float least = 1.0f / 512;
    return weight.x >= least || weight.y >= least || weight.z >= least;
}

static float rti_positive(float x) { return x > 0 ? x : 0; }        /* of NaN: 0 */
)

/* What is left of a beside b where together they exceed 1. */
RTI_SHARED(
static float rti_part_beside(float a, float b) { return a + rti_positive(b) > 1 ? a / (a + rti_positive(b)) : rti_positive(a); }
static rt_vec3 rti_share(rt_vec3 a, rt_vec3 b)
{
    return rti_vec3(rti_part_beside(a.x, b.x), rti_part_beside(a.y, b.y), rti_part_beside(a.z, b.z));
}
)

/* How much of the light is left after that length. */
RTI_SHARED(
static rt_vec3 rti_dim(rt_vec3 absorb, float length)
{
    const rt_vec3 lost = rti_scale(absorb, length);
    return rti_vec3(rti_expf(-rti_positive(lost.x)), rti_expf(-rti_positive(lost.y)), rti_expf(-rti_positive(lost.z)));
}
)

/* The material of a surface, and what is asked of it once, since neighbours tend to have the same. */
RTI_SHARED(
typedef struct { const RTI_GLOBAL rt_material *material; bool shiny, glows; } rti_known;
)

/* From the hit of a ray to the surface that it is on: its lanes, what is known of its material, its tint and, where there is more to trace,
   whether it was met from its inside. Adds what it glows. */
RTI_SHARED(
RTI_INLINE void rti_meet(const rti_world *world, const rt_ray *ray, const rt_hit *hit, rti_path *path, rti_known *known, float *lanes,
                         rt_vec3 *tint, bool *inside, rt_vec3 *sum)
{
    const RTI_GLOBAL rt_material *material;
    const rt_vec3 point = rti_add(ray->org, rti_scale(ray->dir, hit->t));
    const float length = hit->t * sqrtf(rti_dot(ray->dir, ray->dir));
    rti_gaze gaze;
    path->width += rti_keepf(length * world->angle);
    gaze.dir = ray->dir;
    gaze.width = path->width;
    gaze.stretch = 1;
    gaze.inverse = NULL;
    rti_put(lanes, RTI_POINT, point);
    rti_put(lanes, RTI_VIEW, ray->dir);
    lanes[RTI_OFFSET * RTI_ABREAST] = rti_keepf(hit->t * rti_largest(ray->dir)) + rti_largest(point);
    *tint = path->weight;
)
#if RTI_INSTANCES
RTI_SHARED(
    if (RTI_SHOWS(INSTANCES) && hit->inst != RT_NONE) material = rti_look_into(world, hit, point, RTI_SAMPLING_OR(path->time, 0), &gaze, lanes, tint);
    else
)
#endif
RTI_SHARED(
        material = rti_look_up(&world->shape, hit, point, &gaze, lanes, tint);
    if (material != known->material) {
        known->material = material;
        known->shiny = rti_any(material->reflect) || rti_any(material->transmit);
        known->glows = rti_any(material->emission);
    }
    if (known->shiny || path->medium) {
        *inside = rti_dot(rti_get(lanes, RTI_GEOMETRIC), ray->dir) > 0;
        if (*inside && rti_any(material->transmit)) path->medium = material;
        if (path->medium && rti_any(path->medium->absorb)) {
            const rt_vec3 left = rti_dim(path->medium->absorb, length);
            path->weight = rti_mul(path->weight, left);
            *tint = rti_mul(*tint, left);
        }
    }
    *tint = rti_mul(*tint, material->diffuse);
    rti_add_to(sum, *tint, world->ambient);
    if (known->glows) rti_add_to(sum, path->weight, material->emission);
}
)

#if RTI_SAMPLING

/* A branch of the tree takes pairs of numbers in this order: its start, if it is an eye ray's, from the pixel, the lens and the time, as far
   as they matter; lights, one each; lobes. What comes first is stratified together with what comes next: a pixel with its lens or light. */
RTI_SHARED(
static void rti_draw(const rti_film *film, const rti_path *path, uint32_t pair, float u[2])
{
    const uint32_t x = film->left + path->pixel % film->side, y = film->top + path->pixel / film->side;
    rti_sample_2d(&film->sampler, x, y, film->sample, path->branch * 0xf1bbcd88u + pair, u);        /* a multiple of 8 */
}
static bool rti_has_shutter(const rti_film *film) { return film->timed && film->length > 0; }
static uint32_t rti_pairs_of_start(const rti_film *film, const rti_path *path)
{
    return path->branch > 1 ? 0 : (uint32_t)film->spread + (uint32_t)film->lens.open + (uint32_t)rti_has_shutter(film);
}
)

/* The direction at an angle from axis, whose cosine and its square's rest to 1 are given, and somewhere around it. */
RTI_SHARED(
static rt_vec3 rti_around(rt_vec3 axis, float cosine, float sine2, float turn)
{
    const float away = sqrtf(rti_positive(sine2));
    float s, c;
    rt_vec3 x, y;
    rti_circle(turn, &s, &c);
    rti_frame(axis, &x, &y);
    return rti_add(rti_scale(axis, cosine), rti_add(rti_scale(x, away * c), rti_scale(y, away * s)));
}
)

/* A direction around axis, as dense as the nth power of the cosine. */
RTI_SHARED(
static rt_vec3 rti_on_lobe(rt_vec3 axis, float n, const float u[2])
{
    const double cosine = rti_exp(rti_log((double)(1 - u[0])) / (double)(n + 1));       /* u is below 1 */
    return rti_around(axis, (float)cosine, (float)((1 - cosine) * (1 + cosine)), u[1]);
}
)

/* The same for a rough surface; what would go to the wrong side of it is mirrored to the right one, so that nothing is lost. */
RTI_SHARED(
static rt_vec3 rti_roughen(const rti_film *film, const rti_path *path, uint32_t lobe, float roughness, rt_vec3 dir, rt_vec3 geometric,
                           float side)
{
    float u[2], off;
    rti_draw(film, path, rti_pairs_of_start(film, path) + film->light_pairs + lobe, u);
    dir = rti_on_lobe(rti_normalize(dir), 2 / (roughness * roughness) - 2, u);
    off = rti_dot(dir, geometric) * side;
    return off < 0 ? rti_sub(dir, rti_scale(geometric, 2 * off * side)) : dir;
}
)

/* 1 - the cosine of the half angle that a sphere subtends from a distance; inside of it 2: all directions. */
RTI_SHARED(
static float rti_cap(float radius, float distance)
{
    const float sine = radius / distance, sine2 = rti_keepf(sine * sine);
    return sine2 < 1 ? sine2 / (1 + sqrtf(1 - sine2)) : 2;
}
)

/* A point of a sphere as seen from `from`, and what it counts. */
RTI_SHARED(
static rt_vec3 rti_on_sphere(const rt_light *light, rt_vec3 from, const float u[2], float *share)
{
    const rt_vec3 to = rti_sub(light->position, from);
    const float radius = light->radius, distance = sqrtf(rti_dot(to, to)), cap = rti_cap(radius, distance);
    const rt_vec3 axis = distance > 0 ? rti_scale(to, 1 / distance) : rti_vec3(0, 0, 1);
    const float part = rti_keepf(u[0] * (light->by_area ? 2 : cap));      /* 1 - cosine */
    const rt_vec3 dir = rti_around(axis, 1 - part, part * (2 - part), u[1]);
    *share = 1;
    if (light->by_area) {                   /* dir is the outer normal */
        const rt_vec3 at = rti_add(light->position, rti_scale(dir, radius)), back = rti_sub(from, at);
        const float away2 = rti_dot(back, back), cosine = rti_dot(dir, back) / sqrtf(away2);
        *share = cap < 2 ? rti_positive(cosine) * 2 * radius * radius / (away2 * cap) : fabsf(cosine) * radius * radius / away2;
        return at;
    }
    {
        const float along = rti_keepf(distance * (1 - part)), off2 = rti_keepf(distance * distance * part * (2 - part));
        const float deep = sqrtf(rti_positive(rti_keepf(radius * radius) - off2));
        return rti_add(from, rti_scale(dir, cap < 2 ? along - deep : along + deep));
    }
}
)

/* A rectangle as seen from a point: in its own axes, the origin there (Urena et al. 2013). In double: small angles are differences. */
RTI_SHARED(
typedef struct { double x0, x1, y0, y1, z, b0, b1, k, solid; rt_vec3 x, y, out; } rti_window;

static double rti_hypotenuse(double a, double b) { return sqrt(rti_keep(a * a) + rti_keep(b * b)); }
)

/* The sum of the angles, from 0 to pi, that have these cosines. */
RTI_SHARED(
static double rti_sum_arcs(double a, double b)
{
    const double sine_a = sqrt((1 - a) * (1 + a)), sine_b = sqrt((1 - b) * (1 + b));
    const double cosine = rti_keep(a * b) - rti_keep(sine_a * sine_b), sine = rti_keep(sine_a * b) + rti_keep(a * sine_b);
    const double angle = rti_arc_tangent_ratio(fabs(sine), cosine);
    return sine < 0 || (sine == 0 && cosine > 0 && a < 0) ? 6.2831853071795865 - angle : angle;
}
)

RTI_SHARED(
static rti_window rti_make_window(const rt_light *light, rt_vec3 from)
{
    const float width = sqrtf(rti_dot(light->edges[0], light->edges[0])), height = sqrtf(rti_dot(light->edges[1], light->edges[1]));
    const rt_vec3 to = rti_sub(light->position, from);
    double zx[2], zy[2];                    /* of the normals of the four planes through the origin and an edge, + or - */
    rti_window w;
    int i;
    w.x = rti_scale(light->edges[0], 1 / width);
    w.y = rti_scale(light->edges[1], 1 / height);
    w.out = rti_cross(w.x, w.y);
    w.z = (double)rti_dot(to, w.out);
    if (w.z > 0) {
        w.z = -w.z;
        w.out = rti_scale(w.out, -1);
    }
    w.x0 = (double)rti_dot(to, w.x) - (double)width / 2;
    w.x1 = w.x0 + (double)width;
    w.y0 = (double)rti_dot(to, w.y) - (double)height / 2;
    w.y1 = w.y0 + (double)height;
    for (i = 0; i < 2; i++) {
        const double x = i ? w.x1 : w.x0, y = i ? w.y1 : w.y0, rx = rti_hypotenuse(x, w.z), ry = rti_hypotenuse(y, w.z);
        zx[i] = rx > 0 ? x / rx : 0;
        zy[i] = ry > 0 ? y / ry : 0;
    }
    /* n0 = (0, z, -y0), n1 = (-z, 0, x1), n2 = (0, -z, y1), n3 = (z, 0, -x0), each over its length */
    w.b0 = -zy[0];
    w.b1 = zy[1];
    w.k = 6.2831853071795865 - rti_sum_arcs(rti_keep(zy[1] * zx[0]), rti_keep(-zx[0] * zy[0]));
    w.solid = rti_sum_arcs(rti_keep(zy[0] * zx[1]), rti_keep(-zx[1] * zy[1])) - w.k;
    return w;
}
)

RTI_SHARED(
static double rti_clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static rt_vec3 rti_on_rectangle(const rt_light *light, rt_vec3 from, const float u[2], float *share)
{
    const rti_window w = rti_make_window(light, from);
    const double area = (w.x1 - w.x0) * (w.y1 - w.y0);
    double x, y;
    *share = 1;
    if (light->by_area || !(w.solid > 1e-8)) {              /* seen so small, its points count alike to some 1e-4 */
        x = w.x0 + rti_keep((double)u[0] * (w.x1 - w.x0));
        y = w.y0 + rti_keep((double)u[1] * (w.y1 - w.y0));
        if (w.solid > 1e-8) {
            const double away2 = rti_keep(x * x) + rti_keep(y * y) + rti_keep(w.z * w.z);
            *share = (float)(-w.z / (away2 * sqrt(away2)) * area / w.solid);
        }
    } else {
        double sine, cosine, f, c, d, h0, h1, h;
        rti_sine_cosine(rti_keep((double)u[0] * w.solid) + w.k, &sine, &cosine);
        f = (rti_keep(cosine * w.b0) - w.b1) / sine;
        c = rti_clamp((f > 0 ? 1 : -1) / rti_hypotenuse(f, w.b0), -1, 1);
        x = rti_clamp(-(c * w.z) / sqrt(1 - rti_keep(c * c)), w.x0, w.x1);
        d = rti_hypotenuse(x, w.z);
        h0 = w.y0 / rti_hypotenuse(d, w.y0);
        h1 = w.y1 / rti_hypotenuse(d, w.y1);
        h = h0 + rti_keep((double)u[1] * (h1 - h0));
        y = h * h < 1 ? rti_clamp(h * d / sqrt(1 - rti_keep(h * h)), w.y0, w.y1) : h > 0 ? w.y1 : w.y0;
    }
    return rti_add(from, rti_add(rti_scale(w.x, (float)x), rti_add(rti_scale(w.y, (float)y), rti_scale(w.out, (float)w.z))));
}
)

RTI_SHARED(
static bool rti_has_edges(const rt_light *light) { return rti_largest(light->edges[0]) > 0 || rti_largest(light->edges[1]) > 0; }

static bool rti_has_size(const rt_light *light) { return light->radius > 0 || rti_has_edges(light); }
)

/* A point of light `number`, which has a size, for a surface: in its lanes for the way there. Answers what the point counts. */
RTI_SHARED(
static float rti_sample_light(const rti_film *film, const rti_path *path, const rt_light *light, uint32_t number, float *lanes)
{
    const rt_vec3 from = rti_get(lanes, RTI_POINT);
    float u[2], share;
    rti_draw(film, path, rti_pairs_of_start(film, path) + number, u);
    rti_put(lanes, RTI_TO_LIGHT, light->radius > 0 ? rti_on_sphere(light, from, u, &share) : rti_on_rectangle(light, from, u, &share));
    return share;
}
)

#endif

/* Does it show on a surface if a light reaches it? */
RTI_SHARED(
RTI_INLINE bool rti_faces_light(const float *lanes, rt_vec3 tint, const RTI_GLOBAL rt_material *material)
{
    if (!(lanes[RTI_COSINE * RTI_ABREAST] > 0)) return false;
    return rti_any(tint) || (lanes[RTI_HIGHLIGHT * RTI_ABREAST] > 0 && rti_any(material->specular));
}
)

/* Adds what a light does that reaches a surface. */
RTI_SHARED(
RTI_INLINE void rti_shine(const float *lanes, rt_vec3 tint, rt_vec3 weight, const RTI_GLOBAL rt_material *material, rt_vec3 color,
                          rt_vec3 *sum)
{
    const float highlight = lanes[RTI_HIGHLIGHT * RTI_ABREAST];
    rti_add_to(sum, rti_scale(tint, lanes[RTI_COSINE * RTI_ABREAST]), color);
    if (highlight > 0 && rti_any(material->specular))
        rti_add_to(sum, rti_scale(rti_mul(weight, material->specular), rti_powf(highlight, material->shininess)), color);
}
)

/* The direction behind a surface of a ray that came from view, and the part of the light that is mirrored; false: all of it. eta is the
   index of refraction on this side over that on the other. */
RTI_SHARED(
static bool rti_bend(rt_vec3 view, rt_vec3 normal, float eta, rt_vec3 *dir, float *mirrored)
{
    const float c = rti_dot(normal, view), sine2 = rti_keepf(eta * eta * (1 - rti_keepf(c * c))), cosine = sqrtf(1 - sine2);
    const float bent_c = rti_keepf(eta * c), bent_cosine = rti_keepf(eta * cosine);
    const float across = (bent_c - cosine) / (bent_c + cosine), along = (c - bent_cosine) / (c + bent_cosine);
    if (!(sine2 < 1)) return false;
    *dir = rti_sub(rti_scale(normal, bent_c - cosine), rti_scale(view, eta));
    *mirrored = 0.5f * (rti_keepf(across * across) + rti_keepf(along * along));
    return true;
}
)

/* A ray that a surface sends on, and what it carries: from is that of the ray before. */
RTI_SHARED(
RTI_INLINE void rti_send(rt_ray *ray, rti_path *path, rt_vec3 org, rt_vec3 dir, rt_vec3 weight, const RTI_GLOBAL rt_material *medium,
                         const rti_path *from, rti_kind_of_ray kind)
{
    rti_set_ray(ray, org, dir, RTI_INFINITY);
    *path = *from;
    path->weight = weight;
    path->medium = medium;
)
#if RTI_SAMPLING
RTI_SHARED(
    path->branch = 2 * from->branch + (kind == RTI_REFRACT);
)
#endif
RTI_SHARED(
    (void)kind;
}
)

/* The rays that a shiny surface sends on: what is mirrored first, then what is refracted. Answers which there are, in bits 0 and 1. */
RTI_SHARED(
RTI_NOINLINE unsigned rti_bounce_off(const rti_film *film, const rti_path *path, const RTI_GLOBAL rt_material *material, bool inside,
                                     const float *lanes, rt_ray *const rays[2], rti_path *const paths[2])
{
    const rt_vec3 view = rti_get(lanes, RTI_VIEW), geometric = rti_get(lanes, RTI_GEOMETRIC), org = rti_get(lanes, RTI_POINT);
    const rt_vec3 transmit = rti_share(material->transmit, material->reflect);
    rt_vec3 reflect = rti_share(material->reflect, material->transmit), normal = rti_get(lanes, RTI_NORMAL), mirror, through, bent;
    unsigned sent = 0;
    (void)film;
    /* A shading normal that sends the ray to the wrong side of the surface gives way to the geometric one. */
    mirror = rti_sub(rti_scale(normal, 2 * rti_dot(normal, view)), view);
    if (!(rti_dot(normal, view) > 0) || !(rti_dot(mirror, geometric) > 0)) {
        normal = geometric;
        mirror = rti_sub(rti_scale(normal, 2 * rti_dot(normal, view)), view);
    }
    if (RTI_SHOWS(GLASS) && rti_any(transmit)) {
        const float ior = material->ior > 0 ? material->ior : 1, eta = inside ? ior : 1 / ior;
        float part;
        bool open = rti_bend(view, normal, eta, &bent, &part);
        if (open && !(rti_dot(bent, geometric) < 0)) open = rti_bend(view, geometric, eta, &bent, &part);
        if (!open) part = 1;
        else if (!material->fresnel) part = 0;
        reflect = rti_add(reflect, rti_scale(transmit, part));
        through = rti_mul(path->weight, rti_scale(transmit, 1 - part));
        if (open && rti_shows(through)) {
)
#if RTI_SAMPLING
RTI_SHARED(
            if (RTI_SHOWS(ROUGHNESS) && material->roughness > 0) bent = rti_roughen(film, path, 1, material->roughness, bent, geometric, -1);
)
#endif
RTI_SHARED(
            rti_send(rays[1], paths[1], rti_sub(org, rti_scale(geometric, 2 * lanes[RTI_OFFSET * RTI_ABREAST])), bent, through,
                     inside ? NULL : material, path, RTI_REFRACT);
            sent = 2;
        }
    }
    reflect = rti_mul(reflect, path->weight);
    if (rti_shows(reflect)) {
)
#if RTI_SAMPLING
RTI_SHARED(
        if (RTI_SHOWS(ROUGHNESS) && material->roughness > 0) mirror = rti_roughen(film, path, 0, material->roughness, mirror, geometric, 1);
)
#endif
RTI_SHARED(
        rti_send(rays[0], paths[0], org, mirror, reflect, path->medium, path, RTI_REFLECT);
        sent |= 1;
    }
    return sent;
}
)

/* Offset of sample i of n in a pixel: the middle, a grid, or the R2 sequence (Roberts 2018) where n is no square. */
RTI_SHARED(
static void rti_subpixel(int i, int n, float *x, float *y)
{
    int side = 1;
    while ((side + 1) * (side + 1) <= n) side++;
    if (side * side == n) {
        *x = ((float)(i % side) + 0.5f) / (float)side;
        *y = ((float)(i / side) + 0.5f) / (float)side;
    } else {
        double a = 0.5 + rti_keep(0.7548776662466927 * (double)i), b = 0.5 + rti_keep(0.5698402909980532 * (double)i);
        *x = (float)(a - floor(a));
        *y = (float)(b - floor(b));
    }
}
)

RTI_SHARED(
RTI_INLINE void rti_start_path(rti_path *path, uint32_t pixel, float time)
{
    path->weight = rti_vec3(1, 1, 1);
    path->pixel = pixel;
    path->medium = NULL;
    path->width = 0;
)
#if RTI_SAMPLING
RTI_SHARED(
    path->time = time;
    path->branch = 1;
)
#endif
RTI_SHARED(
    (void)time;
}
)

#if RTI_SAMPLING
/* A coordinate in the pixel, whose middle is 0.5, as dense as the filter. */
RTI_SHARED(
static float rti_filtered(rt_filter filter, float u)
{
    if (filter == RT_FILTER_TENT) return u < 0.5f ? sqrtf(2 * u) - 0.5f : 1.5f - sqrtf(2 - 2 * u);
    if (filter == RT_FILTER_GAUSSIAN) {     /* the inverse of the error function (Giles 2010), between -+ 3 deviations */
        const float x = rti_keepf(0.997300204f * (2 * u - 1)), w = -rti_logf((1 - x) * (1 + x));
        const float a = w - 2.5f, b = sqrtf(w) - 3;
        float p;
        if (w < 5) {
            p = 2.81022636e-08f;
            p = 3.43273939e-07f + rti_keepf(p * a);
            p = -3.5233877e-06f + rti_keepf(p * a);
            p = -4.39150654e-06f + rti_keepf(p * a);
            p = 0.00021858087f + rti_keepf(p * a);
            p = -0.00125372503f + rti_keepf(p * a);
            p = -0.00417768164f + rti_keepf(p * a);
            p = 0.246640727f + rti_keepf(p * a);
            p = 1.50140941f + rti_keepf(p * a);
        } else {
            p = -0.000200214257f;
            p = 0.000100950558f + rti_keepf(p * b);
            p = 0.00134934322f + rti_keepf(p * b);
            p = -0.00367342844f + rti_keepf(p * b);
            p = 0.00573950773f + rti_keepf(p * b);
            p = -0.0076224613f + rti_keepf(p * b);
            p = 0.00943887047f + rti_keepf(p * b);
            p = 1.00167406f + rti_keepf(p * b);
            p = 2.83297682f + rti_keepf(p * b);
        }
        return 0.5f + rti_keepf(0.707106781f * p * x);
    }
    return u;
}
)

/* Gives an eye ray what it has of its own: its point in the pixel and on the lens, and its time. */
RTI_SHARED(
RTI_INLINE void rti_spread(const rti_film *film, rti_path *path, rt_ray *ray)
{
    uint32_t pair = 0;
    float u[2];
    if (film->spread) {
        rti_draw(film, path, pair++, u);
        *ray = rti_view_ray(&film->view, (float)(film->left + path->pixel % film->side) + rti_filtered(film->filter, u[0]),
                            (float)(film->top + path->pixel / film->side) + rti_filtered(film->filter, u[1]));
    }
    if (film->lens.open) {
        rti_draw(film, path, pair++, u);
        rti_through_lens(&film->lens, u, ray);
    }
    if (rti_has_shutter(film)) {
        rti_draw(film, path, pair, u);
        path->time = film->open + rti_keepf(film->length * u[0]);
    }
}
)
#endif
#endif
#if RTI_IN(HOST)

/* ---- >>render ------------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

/* A block of pixels is drawn in batches of rays that are traced together: its eye rays, then those that follow, each batch from one
   batch and of one kind, in the order of their pixels on the screen ([Overbeck] 2.4). What is still to trace waits in a stack, of which
   the last rays go first. So memory is bounded, and whatever the size of the batches, what a pixel sees is summed up in the
   same order: a ray, what it sees refracted, what it sees mirrored. */

#define RTI_MAX_BLOCK 32                    /* pixels a side: for packets of 32 x 32 rays */
#define RTI_DEPTH 5                         /* levels, when none are asked for */

/* Waiting rays of one kind and level from one batch; a group lies on top of the one before it. */
typedef struct { size_t count; int level; rti_kind_of_ray kind; } rti_group;

/* One call of rt_render_tile. */
typedef struct {
    const rt_scene *scene;
    const rt_raster *raster;
    rti_batch_function batch;
    rti_finish_function finish;
    rti_aim_function aim;
    rti_job job;
    rti_tuner tuners[2][3];                 /* of closest and any hits; by the kind of ray that is traced, or lit */
    rti_world world;
    rti_film film;
    rt_ray_counts counts;
    int depth, spp, first, samples, side;   /* side: of a block, in pixels */
    int width;                              /* of the picture */
#if RTI_SAMPLING
    const uint32_t *wanted;                 /* counts of the options */
    float *times;                           /* one a ray of the batch, for those below */
    float *shares;                          /* of a light with a size: what its point counts, one a surface */
#endif

    /* One batch, of at most side * side rays. Compacted on the way: first what is traced, then what is seen, then its shadow rays. */
    rt_ray *rays;
    rt_hit *hits;
    rti_path *paths;
    const rt_material **materials;
    rt_vec3 *tints;                         /* weight * diffuse colour */
    bool *inside;                           /* the surface was met from its inside; known where there is more to trace */
    unsigned short *shiny, *lit;            /* surfaces that reflect or transmit; that the shadow rays start from */
    size_t shiny_count;
    rti_surfaces *surfaces;

    rt_vec3 *sums;                          /* of the block's pixels */
    rt_ray *waiting_rays;
    rti_path *waiting;
    size_t waiting_count, waiting_space;
    rti_group groups[2 * RT_MAX_DEPTH];     /* two a level: of all above but the last batch's, only rests are left */
    int group_count;
} rti_render;

/* The numbers of surface i stand RTI_ABREAST apart from there. */
RTI_INLINE float *rti_lanes(rti_surfaces *s, size_t i) { return s[i / RTI_ABREAST].lanes + i % RTI_ABREAST; }

/* From the n hits of a batch to the surfaces that they are on, whose number is answered; adds what those glow, and the background. */
static size_t rti_look_at(rti_render *r, size_t n, bool last)
{
    rti_known known = { NULL, false, false };
    size_t i, seen = 0;
    r->shiny_count = 0;
    for (i = 0; i < n; i++) {
        rti_path *path = &r->paths[seen];
        rt_vec3 *sum;
        *path = r->paths[i];
        sum = &r->sums[path->pixel];
        if (r->hits[i].prim == RT_NONE) {
            rti_add_to(sum, path->weight, r->world.background);
            continue;
        }
        rti_meet(&r->world, &r->rays[i], &r->hits[i], path, &known, rti_lanes(r->surfaces, seen), &r->tints[seen], &r->inside[seen], sum);
        r->materials[seen] = known.material;
        if (known.shiny && !last) r->shiny[r->shiny_count++] = (unsigned short)seen;
        seen++;
    }
    return seen;
}

/* Adds what the lights make of the surfaces seen. */
static void rti_light_up(rti_render *r, size_t seen, rti_kind_of_ray kind)
{
    const rt_scene *scene = r->scene;
    size_t number, i, m;
    r->job.query = RT_ANY;
    r->job.tuner = &r->tuners[1][kind];
    for (number = 0; number < scene->light_count; number++) {
        const rt_light *light = &scene->lights[number];
        const rt_vec3 color = light->color;
        const bool sized = RTI_SAMPLING_OR(rti_has_size(light), false);
#if RTI_SAMPLING
        for (i = 0; sized && i < seen; i++)
            r->shares[i] = rti_sample_light(&r->film, &r->paths[i], light, (uint32_t)number, rti_lanes(r->surfaces, i));
#endif
        r->aim(r->surfaces, seen, sized ? NULL : &light->position);
        for (i = m = 0; i < seen; i++) {
            const float *lanes = rti_lanes(r->surfaces, i);
            if (!rti_faces_light(lanes, r->tints[i], r->materials[i])) continue;
#if RTI_SAMPLING
            if (sized && !(r->shares[i] > 0)) continue;
            if (r->film.timed) r->times[m] = r->paths[i].time;
#endif
            rti_set_ray(&r->rays[m], rti_get(lanes, RTI_POINT), rti_get(lanes, RTI_TO_LIGHT), 1);
            r->lit[m++] = (unsigned short)i;
        }
        r->batch(scene->accel, &r->job, r->rays, m, r->hits);
        r->counts.shadow += m;
        for (i = 0; i < m; i++) {
            const size_t at = r->lit[i];
            const rti_path *path = &r->paths[at];
            rt_vec3 shone = color;
            if (r->hits[i].prim != RT_NONE) continue;
#if RTI_SAMPLING
            if (sized) shone = rti_scale(color, r->shares[at]);
#endif
            rti_shine(rti_lanes(r->surfaces, at), r->tints[at], path->weight, r->materials[at], shone, &r->sums[path->pixel]);
        }
    }
}

/* Sends rays from the shiny surfaces to the stack: what is mirrored below what is refracted, so that no mirror moves them. */
static void rti_bounce(rti_render *r, int level)
{
    const size_t base = r->waiting_count, most = r->shiny_count;
    size_t i, reflected = 0, refracted = 0;
    RT_ASSERT(base + 2 * most <= r->waiting_space);
    for (i = 0; i < most; i++) {
        const size_t at = r->shiny[i];
        rt_ray *const rays[2] = { r->waiting_rays + base + reflected, r->waiting_rays + base + most + refracted };
        rti_path *const paths[2] = { r->waiting + base + reflected, r->waiting + base + most + refracted };
        const unsigned sent = rti_bounce_off(&r->film, &r->paths[at], r->materials[at], r->inside[at], rti_lanes(r->surfaces, at), rays,
                                             paths);
        reflected += sent & 1;
        refracted += sent >> 1;
    }
    if (reflected < most) {
        memmove(r->waiting_rays + base + reflected, r->waiting_rays + base + most, refracted * sizeof *r->waiting_rays);
        memmove(r->waiting + base + reflected, r->waiting + base + most, refracted * sizeof *r->waiting);
    }
    r->waiting_count = base + reflected + refracted;
    for (i = 0; i < 2; i++) {
        rti_group group;
        group.count = i ? refracted : reflected;
        group.level = level;
        group.kind = i ? RTI_REFRACT : RTI_REFLECT;
        if (group.count) r->groups[r->group_count++] = group;
    }
}

/* Takes the next batch from the stack. Each of its rays frees one place and may send two, so a batch takes at most half of the places that
   are free, and leaves one for each level still to come: there are more at first, and so always enough for one ray. */
static size_t rti_take(rti_render *r)
{
    rti_group *top = &r->groups[r->group_count - 1];
    const size_t more = (size_t)(r->depth - top->level), space = r->waiting_space - r->waiting_count;
    size_t count = top->count, most = (size_t)r->side * (size_t)r->side;
    if (more && most > (space + 1) / 2) most = (space + 1) / 2;
    if (more && most > space - (more - 1)) most = space - (more - 1);
    if (count > most) count = most;
    RT_ASSERT(count > 0);
    top->count -= count;
    if (!top->count) r->group_count--;
    r->waiting_count -= count;
    memcpy(r->rays, r->waiting_rays + r->waiting_count, count * sizeof *r->rays);
    memcpy(r->paths, r->waiting + r->waiting_count, count * sizeof *r->paths);
#if RTI_SAMPLING
    if (r->film.timed) {
        size_t i;
        for (i = 0; i < count; i++) r->times[i] = r->paths[i].time;
    }
#endif
    return count;
}

#define RTI_MAX_SPP  (1 << 20)              /* RT_MAX_SPP, which RT_NO_SAMPLING leaves out */

/* Every other bit of a Morton code of two 5-bit coordinates. */
static unsigned rti_unzip(unsigned code)
{
    code &= 0x155;
    code = (code | code >> 1) & 0x133;
    code = (code | code >> 2) & 0x10f;
    return (code | code >> 4) & 0x1f;
}

/* How many samples a pixel gets. */
RTI_INLINE int rti_samples_of(const rti_render *r, int x, int y)
{
#if RTI_SAMPLING
    const size_t pixel = (size_t)y * (size_t)r->width + (size_t)x;
    if (r->wanted && r->wanted[pixel] < (uint32_t)r->samples) return (int)r->wanted[pixel];
#endif
    (void)x, (void)y;
    return r->samples;
}

/* The eye rays of a block through (dx, dy) of each pixel that gets more than number samples, in Morton order, so that those which follow each
   other are neighbours. */
static size_t rti_look(rti_render *r, const int box[4], int number, float dx, float dy)
{
    const unsigned width = (unsigned)(box[2] - box[0]), height = (unsigned)(box[3] - box[1]), side = (unsigned)r->side;
    const rti_view *view = &r->film.view;
    const rt_vec3 eye = view->eye, corner = view->corner;
    rt_vec3 right[RTI_MAX_BLOCK], down[RTI_MAX_BLOCK];
    rt_ray *ray = r->rays;
    rti_path *path = r->paths;
    unsigned i, k;
    for (i = 0; i < width; i++) right[i] = rti_scale(view->right, (float)(box[0] + (int)i) + dx);
    for (i = 0; i < height; i++) down[i] = rti_scale(view->down, (float)(box[1] + (int)i) + dy);
    for (i = 0; i < side * side / 4; i++) {
        const unsigned left = 2 * rti_unzip(i), top = 2 * rti_unzip(i >> 1);
        for (k = 0; k < 4; k++) {
            const unsigned x = left + k % 2, y = top + k / 2;
            if (x >= width || y >= height || rti_samples_of(r, box[0] + (int)x, box[1] + (int)y) <= number) continue;
            rti_set_ray(ray++, eye, rti_add(corner, rti_add(right[x], down[y])), RTI_INFINITY);     /* the arithmetic of rti_view_ray */
            rti_start_path(path++, y * side + x, RTI_SAMPLING_OR(r->film.open, 0));
        }
    }
    return (size_t)(ray - r->rays);
}

/* One sample of every pixel of a block that gets more than number, added to the sums. False: none does. */
static bool rti_render_block(rti_render *r, const int box[4], int number)
{
    const int sample = r->first + number;
    rti_kind_of_ray kind = RTI_EYE;
    size_t n, seen, i;
    int level = 0;
    float dx, dy;
    rti_subpixel(sample, r->spp, &dx, &dy);
    n = rti_look(r, box, number, dx, dy);
    if (!n) return false;
    r->film.left = (uint32_t)box[0];
    r->film.top = (uint32_t)box[1];
#if RTI_SAMPLING
    r->film.sample = (uint32_t)sample;
    for (i = 0; i < n && (r->film.spread || r->film.lens.open || r->film.timed); i++) {
        rti_spread(&r->film, &r->paths[i], &r->rays[i]);
        r->times[i] = r->paths[i].time;
    }
#endif
    r->counts.primary += n;
    if (r->raster) {
        rt_hit *grid = (rt_hit *)(void *)r->waiting;        /* still empty, and larger */
        rti_raster_rectangle(r->raster, box, dx, dy, grid, (size_t)r->side);
        for (i = 0; i < n; i++) r->hits[i] = grid[r->paths[i].pixel];
    }
    for (;;) {
        r->job.query = RT_CLOSEST;
        r->job.tuner = &r->tuners[0][kind];
        if (level || !r->raster) r->batch(r->scene->accel, &r->job, r->rays, n, r->hits);
        seen = rti_look_at(r, n, level == r->depth);
        r->finish(r->surfaces, seen);
        rti_light_up(r, seen, kind);
        if (r->shiny_count) rti_bounce(r, level + 1);
        if (!r->group_count) return true;
        level = r->groups[r->group_count - 1].level;
        kind = r->groups[r->group_count - 1].kind;
        n = rti_take(r);
        if (kind == RTI_REFLECT) r->counts.reflect += n;
        else r->counts.refract += n;
    }
}

/* The next count things of size bytes of a block's memory. */
static void *rti_carve(char **memory, size_t count, size_t size)
{
    void *start = *memory;
    *memory += (count * size + 31) / 32 * 32;
    return start;
}

/* Waiting rays of a block of so many pixels: both kinds from each eye ray, and as many again, so that glass fills packets on the
   next levels too. */
#define RTI_WAITING(pixels) (3 * (pixels) + RT_MAX_DEPTH)

/* Bytes that rti_render_blocks carves up, with 32 for the alignment of each of 15 arrays at most. */
#define RTI_BLOCK_BYTES(pixels) \
    ((pixels) * (sizeof(rt_ray) + sizeof(rt_hit) + sizeof(rti_path) + sizeof(void *) + 2 * sizeof(rt_vec3) + 1 + 4 + RTI_LANE_COUNT * 4 + \
                 (RTI_SAMPLING ? 8 : 0)) + \
     RTI_WAITING(pixels) * (sizeof(rt_ray) + sizeof(rti_path)) + 32 * 15)

static void rti_render_blocks(rti_render *r, char *memory, const int tile[4], int width, rt_vec3 *pixels)
{
    const size_t count = (size_t)r->side * (size_t)r->side;
    int box[4], number, x, y;
    r->film.side = (uint32_t)r->side;
    r->rays = (rt_ray *)rti_carve(&memory, count, sizeof *r->rays);
    r->hits = (rt_hit *)rti_carve(&memory, count, sizeof *r->hits);
    r->paths = (rti_path *)rti_carve(&memory, count, sizeof *r->paths);
    r->materials = (const rt_material **)rti_carve(&memory, count, sizeof *r->materials);
    r->tints = (rt_vec3 *)rti_carve(&memory, count, sizeof *r->tints);
    r->inside = (bool *)rti_carve(&memory, count, sizeof *r->inside);
    r->shiny = (unsigned short *)rti_carve(&memory, count, sizeof *r->shiny);
    r->lit = (unsigned short *)rti_carve(&memory, count, sizeof *r->lit);
    r->surfaces = (rti_surfaces *)rti_carve(&memory, count / RTI_ABREAST, sizeof *r->surfaces);
    memset(r->surfaces, 0, count / RTI_ABREAST * sizeof *r->surfaces);
    r->sums = (rt_vec3 *)rti_carve(&memory, count, sizeof *r->sums);
#if RTI_SAMPLING
    r->times = (float *)rti_carve(&memory, count, sizeof *r->times);
    r->shares = (float *)rti_carve(&memory, count, sizeof *r->shares);
    if (r->film.timed) r->job.times = r->times;
#endif
    r->waiting_space = RTI_WAITING(count);
    r->waiting_rays = (rt_ray *)rti_carve(&memory, r->waiting_space, sizeof *r->waiting_rays);
    r->waiting = (rti_path *)rti_carve(&memory, r->waiting_space, sizeof *r->waiting);
    for (box[1] = tile[1]; box[1] < tile[3]; box[1] += r->side)
        for (box[0] = tile[0]; box[0] < tile[2]; box[0] += r->side) {
            memset(r->sums, 0, count * sizeof *r->sums);
            box[2] = tile[2] < box[0] + r->side ? tile[2] : box[0] + r->side;
            box[3] = tile[3] < box[1] + r->side ? tile[3] : box[1] + r->side;
            for (number = 0; number < r->samples && rti_render_block(r, box, number);) number++;
            for (y = box[1]; y < box[3]; y++)
                for (x = box[0]; x < box[2]; x++) {
                    const int drawn = rti_samples_of(r, x, y);
                    if (drawn)
                        pixels[(size_t)y * (size_t)width + (size_t)x] =
                            rti_scale(r->sums[(y - box[1]) * r->side + x - box[0]], 1 / (float)drawn);
                }
        }
}

RTI_NOINLINE void rti_render_small(rti_render *r, const int tile[4], int width, rt_vec3 *pixels)
{
    union { rti_surfaces aligned; char bytes[RTI_BLOCK_BYTES(RTI_BLOCK_RAYS)]; } memory;
    r->side = RTI_BLOCK;
    rti_render_blocks(r, memory.bytes, tile, width, pixels);
}

RTI_NOINLINE void rti_render_large(rti_render *r, const int tile[4], int width, rt_vec3 *pixels)
{
    union { rti_surfaces aligned; char bytes[RTI_BLOCK_BYTES(RTI_MAX_BLOCK * RTI_MAX_BLOCK)]; } memory;
    r->side = RTI_MAX_BLOCK;
    rti_render_blocks(r, memory.bytes, tile, width, pixels);
}

/* Of the outermost scene alone, since every tile asks: parts may be millions. rti_look_into asserts those that are seen. */
static rt_status rti_scene_lacks(const rt_scene *scene, rt_error *error)
{
    if (!scene->accel || !scene->geometry) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "scene lacks its accel or its geometry");
    if (scene->texcoords && !scene->texcoord_indices)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "scene has texcoords without texcoord_indices");
    if (scene->normals && !scene->normal_indices)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "scene has normals without normal_indices");
    if (rti_instance_count(scene->geometry) && !scene->parts)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "scene has instances but no parts to say how they are shaded");
    return RT_OK;
}

static bool rti_is_amount(float x) { return x >= 0 && x <= FLT_MAX; }       /* false for NaN */
static bool rti_are_amounts(rt_vec3 a) { return rti_is_amount(a.x) && rti_is_amount(a.y) && rti_is_amount(a.z); }

static rt_status rti_check_texture(const rt_texture *texture, const char *name, size_t number, rt_error *error)
{
    if (!texture) return RT_OK;
    if ((unsigned)texture->kind >= RT_TEXTURE_COUNT)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: kind %d is none of rt_texture_kind", (unsigned long)number, name,
                        (int)texture->kind);
    if (!(texture->size >= 0 && texture->size <= RT_MAX_COORDINATE))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: size is negative, not finite or too large", (unsigned long)number,
                        name);
    if (texture->kind != RT_TEXTURE_IMAGE && (!rti_are_amounts(texture->colors[0]) || !rti_are_amounts(texture->colors[1])))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: a color is negative or not finite", (unsigned long)number, name);
    if (texture->kind == RT_TEXTURE_IMAGE && !rt_count_texture_levels(texture->width, texture->height))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: an image of %d x %d: each must lie between 1 and %d",
                        (unsigned long)number, name, texture->width, texture->height, 1 << 14);
    if (texture->kind == RT_TEXTURE_IMAGE && !texture->levels)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: an image without levels", (unsigned long)number, name);
    if (texture->kind == RT_TEXTURE_IMAGE && texture->solid)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu, %s: an image cannot be solid", (unsigned long)number, name);
    return RT_OK;
}

#if RTI_SAMPLING
static rt_status rti_check_light(const rt_light *light, size_t number, rt_error *error)
{
    const rt_vec3 a = light->edges[0], b = light->edges[1];
    const float numbers[] = { a.x, a.y, a.z, b.x, b.y, b.z };
    size_t k;
    if (!(light->radius >= 0 && light->radius <= RT_MAX_COORDINATE))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: its radius is negative, not finite or too large", (unsigned long)number);
    for (k = 0; k < 6; k++)
        if (!rti_coordinate_ok(numbers[k]))
            return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: an edge is not finite or too large", (unsigned long)number);
    if (!rti_has_edges(light)) return RT_OK;
    if (light->radius > 0)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: it has a radius and edges; it can be a sphere or a rectangle",
                        (unsigned long)number);
    if (!(rti_largest(a) > 0 && rti_largest(b) > 0) || !(fabsf(rti_dot(rti_normalize(a), rti_normalize(b))) <= 1e-3f))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: its edges do not meet at right angles", (unsigned long)number);
    return RT_OK;
}
#endif

RT_API rt_status rt_check_scene(const rt_scene *scene, rt_error *error)
{
    static const char *const names[] = { "diffuse", "specular", "emission", "reflect", "transmit", "absorb", "shininess", "ior" };
    const rt_geometry *geo;
    rt_status status;
    size_t i, k, solid;
    if (!scene) return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "scene is NULL");
    if ((status = rti_scene_lacks(scene, error)) != RT_OK) return status;
    geo = scene->geometry;
    for (i = 0; i < scene->material_count; i++) {
        const rt_material *m = &scene->materials[i];
        const bool good[] = { rti_are_amounts(m->diffuse), rti_are_amounts(m->specular), rti_are_amounts(m->emission),
                              rti_are_amounts(m->reflect), rti_are_amounts(m->transmit), rti_are_amounts(m->absorb),
                              rti_is_amount(m->shininess), rti_is_amount(m->ior) };
        for (k = 0; k < sizeof good / sizeof good[0]; k++)
            if (!good[k])
                return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu: %s is negative or not finite", (unsigned long)i,
                                names[k]);
        if (!(fabsf(m->bump_height) <= RT_MAX_COORDINATE))
            return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu: bump_height is not finite or too large", (unsigned long)i);
        if ((status = rti_check_texture(m->texture, "texture", i, error)) != RT_OK) return status;
        if ((status = rti_check_texture(m->bump, "bump", i, error)) != RT_OK) return status;
#if RTI_SAMPLING
        if (!(m->roughness >= 0 && m->roughness <= 1))
            return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "material %lu: roughness does not lie between 0 and 1", (unsigned long)i);
#endif
    }
    for (i = 0; i < scene->light_count; i++) {
        if (!(rti_largest(scene->lights[i].position) <= RT_MAX_COORDINATE) || scene->lights[i].position.y != scene->lights[i].position.y)
            return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: its position is not finite or out of range", (unsigned long)i);
        if (!rti_are_amounts(scene->lights[i].color))
            return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "light %lu: its color is negative or not finite", (unsigned long)i);
#if RTI_SAMPLING
        if ((status = rti_check_light(&scene->lights[i], i, error)) != RT_OK) return status;
#endif
    }
    if (!rti_are_amounts(scene->ambient) || !rti_are_amounts(scene->background))
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "%s is negative or not finite",
                        rti_are_amounts(scene->ambient) ? "background" : "ambient");
    solid = geo->triangle_count + rti_sphere_count(geo);
    for (i = 0; scene->material_ids && scene->material_count && i < solid + rti_plane_count(geo); i++)
        if (scene->material_ids[i] >= scene->material_count)
            return rti_fail(error, RT_ERROR_ARGUMENT, (uint32_t)i, "primitive %lu: material %lu of %lu", (unsigned long)i,
                            (unsigned long)scene->material_ids[i], (unsigned long)scene->material_count);
#if RTI_INSTANCES
    for (i = 0; i < geo->instance_count; i++)
        if (!scene->parts[i] || !scene->parts[i]->accel || !scene->parts[i]->geometry)
            return rti_fail(error, RT_ERROR_ARGUMENT, (uint32_t)(solid + i), "primitive %lu, an instance: its part is missing or lacks its "
                            "accel or its geometry", (unsigned long)(solid + i));
#endif
    return RT_OK;
}

#if RTI_SAMPLING
static rt_status rti_check_distribution(const rt_render_options *opt)
{
    const rt_lens *lens = &opt->lens;
    if (!(lens->radius >= 0 && lens->radius <= RT_MAX_COORDINATE))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "lens: radius is %g: it must lie between 0 (a pinhole) and %g",
                        (double)lens->radius, (double)RT_MAX_COORDINATE);
    if (!(lens->focus >= 0 && lens->focus <= RT_MAX_COORDINATE))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "lens: focus is %g: it must lie between 0 (as deep as look) and %g",
                        (double)lens->focus, (double)RT_MAX_COORDINATE);
    if (!(lens->open >= 0 && lens->open <= lens->close && lens->close <= 1))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "shutter: open is %g and close %g: they must be 0 <= open <= close <= 1",
                        (double)lens->open, (double)lens->close);
    if ((unsigned)opt->sampler >= RT_SAMPLER_COUNT)
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "sampler %d is none of rt_sampler_kind", (int)opt->sampler);
    if ((unsigned)opt->filter >= RT_FILTER_COUNT)
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "filter %d is none of rt_filter", (int)opt->filter);
    if (opt->counts && opt->sampler == RT_SAMPLER_AUTO)
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "counts need a sampler other than auto");
    if (opt->raster && (lens->radius > 0 || lens->close > 0 || opt->sampler != RT_SAMPLER_AUTO || opt->filter != RT_FILTER_BOX))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE,
                        "raster is of a pinhole at time 0: lens and shutter must be 0, sampler auto and filter box");
    return RT_OK;
}

static bool rti_moves(const rt_accel *accel)
{
#if RTI_INSTANCES
    return accel->moves;
#else
    (void)accel;
    return false;
#endif
}

/* Up to the last light with a size. */
static uint32_t rti_light_pairs(const rt_light *lights, size_t count)
{
    while (count && !rti_has_size(&lights[count - 1])) count--;
    return (uint32_t)count;
}

static void rti_set_distribution(rti_film *film, const rt_camera *camera, bool moves, const rt_render_options *opt, int spp)
{
    film->sampler.kind = opt->sampler;
    film->sampler.spp = (uint32_t)spp;
    film->sampler.seed = opt->seed;
    film->sampler.frame = opt->frame;
    film->filter = opt->filter;
    film->spread = opt->sampler != RT_SAMPLER_AUTO || opt->filter != RT_FILTER_BOX;
    film->lens = rti_make_aperture(camera, &film->view, &opt->lens);
    film->timed = opt->lens.close > 0 && moves;
    film->open = opt->lens.open;
    film->length = opt->lens.close - opt->lens.open;
}
#endif

/* How wide a ray of a sample is after a unit of length. */
static float rti_angle_of(const rti_view *view, int spp) { return sqrtf(rti_dot(view->right, view->right) / (float)spp); }

static void rti_set_world(rti_render *r, const rt_scene *scene, int width, int height)
{
    r->scene = scene;
    r->film.view = rti_make_view(&scene->camera, width, height);
    r->world.shape = rti_shape_of(scene);
    r->world.ambient = scene->ambient;
    r->world.background = scene->background;
    r->world.angle = rti_angle_of(&r->film.view, r->spp);
#if RTI_INSTANCES
    r->world.accel = scene->accel;
    r->world.part = scene;
#endif
}

/* The kernels of the widest packets. */
static void rti_choose_shaders(rti_render *r, rt_isa isa)
{
    if (isa == RT_ISA_AUTO) isa = rt_best_isa();
    r->finish = rti_finish_1;
    r->aim = rti_aim_1;
#if RTI_PACKETS
    r->finish = rti_finish_4;
    r->aim = rti_aim_4;
#if RTI_X86
    if (isa != RT_ISA_AVX2) return;
    r->finish = rti_finish_8;
    r->aim = rti_aim_8;
#endif
#endif
}

static int rti_spp_of(const rt_render_options *opt) { return opt->spp ? opt->spp : 1; }
static int rti_drawn_of(const rt_render_options *opt) { return opt->samples ? opt->samples : rti_spp_of(opt) - opt->first_sample; }

/* What rt_render_tile is given, but for the scene. */
static rt_status rti_check_tile(const rt_render_options *opt, const int tile[4])
{
    rt_error *const error = opt->trace.error;
    if (opt->width < 1 || opt->height < 1 || opt->width > RTI_MAX_SIDE || opt->height > RTI_MAX_SIDE)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "a picture of %d x %d: each must lie between 1 and %d", opt->width, opt->height,
                        RTI_MAX_SIDE);
    if (tile[0] < 0 || tile[1] < 0 || tile[0] > tile[2] || tile[1] > tile[3] || tile[2] > opt->width || tile[3] > opt->height)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "the tile (%d, %d) to (%d, %d) leaves the picture of %d x %d", tile[0], tile[1],
                        tile[2], tile[3], opt->width, opt->height);
    if (opt->spp < 0 || opt->spp > RTI_MAX_SPP)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "spp is %d: it must lie between 0 (as 1) and %d", opt->spp, RTI_MAX_SPP);
    if (opt->first_sample < 0 || opt->samples < 0 || opt->first_sample >= rti_spp_of(opt) || opt->samples > rti_spp_of(opt) - opt->first_sample)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "first_sample is %d and samples %d: they are some of the spp %d", opt->first_sample,
                        opt->samples, rti_spp_of(opt));
    if (opt->depth > RT_MAX_DEPTH)
        return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "depth is %d: it must be negative (none), 0 (as %d) or at most %d", opt->depth,
                        RTI_DEPTH, RT_MAX_DEPTH);
#if RTI_SAMPLING
    return rti_check_distribution(opt);
#else
    return RT_OK;
#endif
}

static rt_status rti_check_camera(const rt_camera *camera, rt_error *error)
{
    if (camera->fov > 0 && camera->fov < 180) return RT_OK;
    return rti_fail(error, RT_ERROR_ARGUMENT, RT_NONE, "the camera's fov must lie between 0 and 180 degrees");
}

static int rti_depth_of(const rt_render_options *opt) { return opt->depth > 0 ? opt->depth : opt->depth ? 0 : RTI_DEPTH; }

RT_API rt_status rt_render_tile(const rt_scene *scene, const rt_render_options *opt, int x0, int y0, int x1, int y1, rt_vec3 *pixels,
                                rt_ray_counts *rays)
{
    const int tile[4] = { x0, y0, x1, y1 };
    rti_render r;
    rt_status status;
    if (!opt) return RT_ERROR_ARGUMENT;     /* nowhere to put a message */
    if (!scene || !pixels) return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE, "%s is NULL", scene ? "pixels" : "scene");
    if ((status = rti_check_tile(opt, tile)) != RT_OK) return status;
    if ((status = rti_check_camera(&scene->camera, opt->trace.error)) != RT_OK) return status;
    if ((status = rti_scene_lacks(scene, opt->trace.error)) != RT_OK) return status;
    if (opt->raster && !rti_raster_fits(opt->raster, scene->geometry, &scene->camera, opt->width, opt->height))
        return rti_fail(opt->trace.error, RT_ERROR_ARGUMENT, RT_NONE,
                        "raster was made for another picture: geometry, camera, width and height must be the scene's");
    memset(&r, 0, sizeof r);
    if ((status = rti_choose(scene->accel, &opt->trace, RTI_BLOCK_RAYS, &r.batch, &r.job)) != RT_OK) return status;
    rti_choose_shaders(&r, opt->trace.isa);
                                            /* a tile is too short to try what never was slower by much: eye rays go as large packets */
    r.tuners[0][RTI_EYE].rest = UINT_MAX;
    r.raster = opt->raster;
    r.spp = rti_spp_of(opt);
    r.first = opt->first_sample;
    r.samples = rti_drawn_of(opt);
    r.width = opt->width;
    r.depth = rti_depth_of(opt);
    rti_set_world(&r, scene, opt->width, opt->height);
    r.job.times = NULL;
#if RTI_SAMPLING
    r.wanted = opt->counts;
    r.film.light_pairs = rti_light_pairs(scene->lights, scene->light_count);
    rti_set_distribution(&r.film, &scene->camera, rti_moves(scene->accel), opt, r.spp);
#endif
    if (opt->trace.packet_width > RTI_BLOCK) rti_render_large(&r, tile, opt->width, pixels);
    else rti_render_small(&r, tile, opt->width, pixels);
    if (rays) {
        rays->primary += r.counts.primary;
        rays->shadow += r.counts.shadow;
        rays->reflect += r.counts.reflect;
        rays->refract += r.counts.refract;
    }
    return RT_OK;
}

#endif /* RT_NO_SHADING */
#endif
#endif /* RT_IMPLEMENTATION */

#else /* RTI_PASS */

/* ==== one pass: the kernels for RTI_WIDTH rays ======================================================================= */

/* ---- >>wide --------------------------------------------------------------------------------------------------------- */

/* v: RTI_WIDTH floats; d: RTI_WIDTH doubles; a set of lanes is an unsigned, bit i for lane i. vmin and vmax answer the second operand
   where either is NaN; vfma, a * b + c, may round once or twice: it is not for what must agree. vplane is how far along a ray an
   axis-aligned plane lies; its origin is what vorigin makes of the ray's. vquad repeats four numbers; vapart tells whether, of lanes 0 to
   3, the least of a is below the greatest of b; vleast and vmost are the least and the greatest lane,
   and lane i of vleasts is the least of the i-th. Every name gets the pass's suffix, so a profile shows which one ran. */
#define RTI_NAME_(name) RTI_PASTE(name, RTI_SUFFIX)
#define rti_v RTI_NAME_(rti_v)
#define rti_d RTI_NAME_(rti_d)
#define rti_vset RTI_NAME_(rti_vset)
#define rti_vid RTI_NAME_(rti_vid)
#define rti_vload RTI_NAME_(rti_vload)
#define rti_vstore RTI_NAME_(rti_vstore)
#define rti_vadd RTI_NAME_(rti_vadd)
#define rti_vsub RTI_NAME_(rti_vsub)
#define rti_vmul RTI_NAME_(rti_vmul)
#define rti_vdiv RTI_NAME_(rti_vdiv)
#define rti_vmin RTI_NAME_(rti_vmin)
#define rti_vmax RTI_NAME_(rti_vmax)
#define rti_vabs RTI_NAME_(rti_vabs)
#define rti_vsign RTI_NAME_(rti_vsign)
#define rti_vlt RTI_NAME_(rti_vlt)
#define rti_vle RTI_NAME_(rti_vle)
#define rti_vnegative RTI_NAME_(rti_vnegative)
#define rti_vselect RTI_NAME_(rti_vselect)
#define rti_vround RTI_NAME_(rti_vround)
#define rti_vorigin RTI_NAME_(rti_vorigin)
#define rti_vplane RTI_NAME_(rti_vplane)
#define rti_dset RTI_NAME_(rti_dset)
#define rti_dload RTI_NAME_(rti_dload)
#define rti_dstore RTI_NAME_(rti_dstore)
#define rti_dadd RTI_NAME_(rti_dadd)
#define rti_dsub RTI_NAME_(rti_dsub)
#define rti_dmul RTI_NAME_(rti_dmul)
#define rti_ddiv RTI_NAME_(rti_ddiv)
#define rti_dsqrt RTI_NAME_(rti_dsqrt)
#define rti_dmin RTI_NAME_(rti_dmin)
#define rti_dmax RTI_NAME_(rti_dmax)
#define rti_dlt RTI_NAME_(rti_dlt)
#define rti_dselect RTI_NAME_(rti_dselect)
#define rti_widen RTI_NAME_(rti_widen)
#define rti_narrow RTI_NAME_(rti_narrow)
#define rti_packet RTI_NAME_(rti_packet)
#define rti_load_rays RTI_NAME_(rti_load_rays)
#define rti_orient RTI_NAME_(rti_orient)
#define rti_least RTI_NAME_(rti_least)
#define rti_pad RTI_NAME_(rti_pad)
#define rti_invert_dir RTI_NAME_(rti_invert_dir)
#define rti_prepare RTI_NAME_(rti_prepare)
#define rti_slab RTI_NAME_(rti_slab)
#define rti_make_slab RTI_NAME_(rti_make_slab)
#define rti_cross_slab RTI_NAME_(rti_cross_slab)
#define rti_hit_box RTI_NAME_(rti_hit_box)
#define rti_slabs RTI_NAME_(rti_slabs)
#define rti_make_slabs RTI_NAME_(rti_make_slabs)
#define rti_accept RTI_NAME_(rti_accept)
#define rti_edge RTI_NAME_(rti_edge)
#define rti_edge_exact RTI_NAME_(rti_edge_exact)
#define rti_product RTI_NAME_(rti_product)
#define rti_dot_exact RTI_NAME_(rti_dot_exact)
#define rti_shear RTI_NAME_(rti_shear)
#define rti_make_shear RTI_NAME_(rti_make_shear)
#define rti_decide RTI_NAME_(rti_decide)
#define rti_hit_triangle RTI_NAME_(rti_hit_triangle)
#define rti_hit_triangles RTI_NAME_(rti_hit_triangles)
#define rti_hit_spheres RTI_NAME_(rti_hit_spheres)
#define rti_enter_instance RTI_NAME_(rti_enter_instance)
#define rti_leave_instance RTI_NAME_(rti_leave_instance)
#define rti_hit_instances RTI_NAME_(rti_hit_instances)
#define rti_hit_leaf RTI_NAME_(rti_hit_leaf)
#define rti_walk_body RTI_NAME_(rti_walk_body)
#define rti_walk_wide RTI_NAME_(rti_walk_wide)
#define rti_probe RTI_NAME_(rti_probe)
#define rti_make_probe RTI_NAME_(rti_make_probe)
#define rti_wide_from RTI_NAME_(rti_wide_from)
#define rti_interval RTI_NAME_(rti_interval)
#define rti_bound_lanes RTI_NAME_(rti_bound_lanes)
#define rti_make_interval RTI_NAME_(rti_make_interval)
#define rti_cross_interval RTI_NAME_(rti_cross_interval)
#define rti_meet_lanes RTI_NAME_(rti_meet_lanes)
#define rti_sheaf_octet RTI_NAME_(rti_sheaf_octet)
#define rti_sheaf_body RTI_NAME_(rti_sheaf_body)
#define rti_sheaf_closest RTI_NAME_(rti_sheaf_closest)
#define rti_sheaf_any RTI_NAME_(rti_sheaf_any)
#define rti_crowd RTI_NAME_(rti_crowd)
#define rti_make_crowd RTI_NAME_(rti_make_crowd)
#define rti_crowd_part RTI_NAME_(rti_crowd_part)
#define rti_wide_boxes RTI_NAME_(rti_wide_boxes)
#define rti_wide_box RTI_NAME_(rti_wide_box)
#define rti_octet_boxes RTI_NAME_(rti_octet_boxes)
#define rti_crowd_meets RTI_NAME_(rti_crowd_meets)
#define rti_crowd_enters RTI_NAME_(rti_crowd_enters)
#define rti_crowd_note RTI_NAME_(rti_crowd_note)
#define rti_crowd_octet RTI_NAME_(rti_crowd_octet)
#define rti_crowd_others RTI_NAME_(rti_crowd_others)
#define rti_crowd_body RTI_NAME_(rti_crowd_body)
#define rti_crowd_closest RTI_NAME_(rti_crowd_closest)
#define rti_crowd_any RTI_NAME_(rti_crowd_any)
#define rti_crowd_closest_count RTI_NAME_(rti_crowd_closest_count)
#define rti_crowd_any_count RTI_NAME_(rti_crowd_any_count)
#define rti_walk_crowd RTI_NAME_(rti_walk_crowd)
#define rti_count_list RTI_NAME_(rti_count_list)
#define rti_batch_crowds RTI_NAME_(rti_batch_crowds)
#define rti_crowd_packets RTI_NAME_(rti_crowd_packets)
#define rti_probe_children RTI_NAME_(rti_probe_children)
#define rti_hit_octet RTI_NAME_(rti_hit_octet)
#define rti_accept_lanes RTI_NAME_(rti_accept_lanes)
#define rti_gather_octet RTI_NAME_(rti_gather_octet)
#define rti_wide_body RTI_NAME_(rti_wide_body)
#define rti_wide_closest RTI_NAME_(rti_wide_closest)
#define rti_wide_any RTI_NAME_(rti_wide_any)
#define rti_wide_closest_all RTI_NAME_(rti_wide_closest_all)
#define rti_wide_any_all RTI_NAME_(rti_wide_any_all)
#define rti_wide_closest_count RTI_NAME_(rti_wide_closest_count)
#define rti_wide_any_count RTI_NAME_(rti_wide_any_count)
#define rti_walk RTI_NAME_(rti_walk)
#define rti_walk_closest RTI_NAME_(rti_walk_closest)
#define rti_walk_any RTI_NAME_(rti_walk_any)
#define rti_walk_closest_all RTI_NAME_(rti_walk_closest_all)
#define rti_walk_any_all RTI_NAME_(rti_walk_any_all)
#define rti_walk_closest_count RTI_NAME_(rti_walk_closest_count)
#define rti_walk_any_count RTI_NAME_(rti_walk_any_count)
#define rti_kdstate RTI_NAME_(rti_kdstate)
#define rti_kdray RTI_NAME_(rti_kdray)
#define rti_kdring RTI_NAME_(rti_kdring)
#define rti_kd_push RTI_NAME_(rti_kd_push)
#define rti_kd_cross RTI_NAME_(rti_kd_cross)
#define rti_hit_run RTI_NAME_(rti_hit_run)
#define rti_hit_others RTI_NAME_(rti_hit_others)
#define rti_large_others RTI_NAME_(rti_large_others)
#define rti_kd_hit_leaf RTI_NAME_(rti_kd_hit_leaf)
#define rti_kd_stack_body RTI_NAME_(rti_kd_stack_body)
#define rti_kd_restart_body RTI_NAME_(rti_kd_restart_body)
#define rti_kd_begin RTI_NAME_(rti_kd_begin)
#define rti_kd_enter RTI_NAME_(rti_kd_enter)
#define rti_kd_stack_closest RTI_NAME_(rti_kd_stack_closest)
#define rti_kd_stack_any RTI_NAME_(rti_kd_stack_any)
#define rti_kd_stack_closest_count RTI_NAME_(rti_kd_stack_closest_count)
#define rti_kd_stack_any_count RTI_NAME_(rti_kd_stack_any_count)
#define rti_kd_restart_closest RTI_NAME_(rti_kd_restart_closest)
#define rti_kd_restart_any RTI_NAME_(rti_kd_restart_any)
#define rti_kd_restart_any_all RTI_NAME_(rti_kd_restart_any_all)
#define rti_kd_restart_closest_all RTI_NAME_(rti_kd_restart_closest_all)
#define rti_kd_restart_closest_count RTI_NAME_(rti_kd_restart_closest_count)
#define rti_kd_restart_any_count RTI_NAME_(rti_kd_restart_any_count)
#define rti_kd_stack_closest_all RTI_NAME_(rti_kd_stack_closest_all)
#define rti_kd_stack_any_all RTI_NAME_(rti_kd_stack_any_all)
#define rti_kd_walker RTI_NAME_(rti_kd_walker)
#define rti_tree_walker RTI_NAME_(rti_tree_walker)
#define rti_walker RTI_NAME_(rti_walker)
#define rti_walker_of RTI_NAME_(rti_walker_of)
#define rti_single_walk RTI_NAME_(rti_single_walk)
#define rti_wide_root_closest RTI_NAME_(rti_wide_root_closest)
#define rti_wide_root_any RTI_NAME_(rti_wide_root_any)
#define rti_walk_nothing RTI_NAME_(rti_walk_nothing)
#define rti_walk_planes RTI_NAME_(rti_walk_planes)
#define rti_hit_planes RTI_NAME_(rti_hit_planes)
#define rti_sweep RTI_NAME_(rti_sweep)
#define rti_make_sweep RTI_NAME_(rti_make_sweep)
#define rti_meet_sphere RTI_NAME_(rti_meet_sphere)
#define rti_thread_state RTI_NAME_(rti_thread_state)
#define rti_thread_start RTI_NAME_(rti_thread_start)
#define rti_thread_enter RTI_NAME_(rti_thread_enter)
#define rti_thread_leave RTI_NAME_(rti_thread_leave)
#define rti_thread_body RTI_NAME_(rti_thread_body)
#define rti_thread_closest RTI_NAME_(rti_thread_closest)
#define rti_thread_any RTI_NAME_(rti_thread_any)
#define rti_thread_closest_all RTI_NAME_(rti_thread_closest_all)
#define rti_thread_any_all RTI_NAME_(rti_thread_any_all)
#define rti_thread_closest_count RTI_NAME_(rti_thread_closest_count)
#define rti_thread_any_count RTI_NAME_(rti_thread_any_count)
#define rti_thread_closest_round RTI_NAME_(rti_thread_closest_round)
#define rti_thread_any_round RTI_NAME_(rti_thread_any_round)
#define rti_thread_aim RTI_NAME_(rti_thread_aim)
#define rti_thread_walker RTI_NAME_(rti_thread_walker)
#define rti_thread_groups RTI_NAME_(rti_thread_groups)
#define rti_batch_parallel RTI_NAME_(rti_batch_parallel)
#define rti_vfma RTI_NAME_(rti_vfma)
#define rti_vquad RTI_NAME_(rti_vquad)
#define rti_lowest_of RTI_NAME_(rti_lowest_of)
#define rti_vapart RTI_NAME_(rti_vapart)
#define rti_vleast RTI_NAME_(rti_vleast)
#define rti_vleasts RTI_NAME_(rti_vleasts)
#define rti_crowd_least RTI_NAME_(rti_crowd_least)
#define rti_crowd_most RTI_NAME_(rti_crowd_most)
#define rti_vmost RTI_NAME_(rti_vmost)
#define rti_large RTI_NAME_(rti_large)
#define rti_door RTI_NAME_(rti_door)
#define rti_make_door RTI_NAME_(rti_make_door)
#define rti_pass RTI_NAME_(rti_pass)
#define rti_lane_range RTI_NAME_(rti_lane_range)
#define rti_range RTI_NAME_(rti_range)
#define rti_no_range RTI_NAME_(rti_no_range)
#define rti_range_add RTI_NAME_(rti_range_add)
#define rti_prepare_shared RTI_NAME_(rti_prepare_shared)
#define rti_survey_slopes RTI_NAME_(rti_survey_slopes)
#define rti_bound_general RTI_NAME_(rti_bound_general)
#define rti_make_frustum RTI_NAME_(rti_make_frustum)
#define rti_cull_box RTI_NAME_(rti_cull_box)
#define rti_facets RTI_NAME_(rti_facets)
#define rti_edges RTI_NAME_(rti_edges)
#define rti_between_planes RTI_NAME_(rti_between_planes)
#define rti_hit_facets RTI_NAME_(rti_hit_facets)
#define rti_facets_closest RTI_NAME_(rti_facets_closest)
#define rti_facets_any RTI_NAME_(rti_facets_any)
#define rti_facets_closest_likely RTI_NAME_(rti_facets_closest_likely)
#define rti_facets_any_likely RTI_NAME_(rti_facets_any_likely)
#define rti_note RTI_NAME_(rti_note)
#define rti_count_rays RTI_NAME_(rti_count_rays)
#define rti_large_triangles RTI_NAME_(rti_large_triangles)
#define rti_large_instances RTI_NAME_(rti_large_instances)
#define rti_large_leaf RTI_NAME_(rti_large_leaf)
#define rti_ask RTI_NAME_(rti_ask)
#define rti_beside RTI_NAME_(rti_beside)
#define rti_first_hit RTI_NAME_(rti_first_hit)
#define rti_last_hit RTI_NAME_(rti_last_hit)
#define rti_part_rays RTI_NAME_(rti_part_rays)
#define rti_mask_rays RTI_NAME_(rti_mask_rays)
#define rti_large_body RTI_NAME_(rti_large_body)
#define rti_walk_masked RTI_NAME_(rti_walk_masked)
#define rti_walk_ranged RTI_NAME_(rti_walk_ranged)
#define rti_walk_partition RTI_NAME_(rti_walk_partition)
#define rti_walk_masked_count RTI_NAME_(rti_walk_masked_count)
#define rti_walk_ranged_count RTI_NAME_(rti_walk_ranged_count)
#define rti_walk_partition_count RTI_NAME_(rti_walk_partition_count)
#define rti_close_lanes RTI_NAME_(rti_close_lanes)
#define rti_large_walk RTI_NAME_(rti_large_walk)
#define rti_take_rays RTI_NAME_(rti_take_rays)
#define rti_give_hits RTI_NAME_(rti_give_hits)
#define rti_fetch RTI_NAME_(rti_fetch)
#define rti_batch_packets RTI_NAME_(rti_batch_packets)
#define rti_no_hits RTI_NAME_(rti_no_hits)
#define rti_take_lanes RTI_NAME_(rti_take_lanes)
#define rti_give_lanes RTI_NAME_(rti_give_lanes)
#define rti_batch_run RTI_NAME_(rti_batch_run)
#define rti_batch_auto RTI_NAME_(rti_batch_auto)
#define rti_batch_large RTI_NAME_(rti_batch_large)
#define rti_batch_largest RTI_NAME_(rti_batch_largest)
#define rti_batch RTI_NAME_(rti_batch)
#define rti_triangles_from_eye RTI_NAME_(rti_triangles_from_eye)
#define rti_wide_row RTI_NAME_(rti_wide_row)
#define rti_see_triangles RTI_NAME_(rti_see_triangles)
#define rti_slopes RTI_NAME_(rti_slopes)
#define rti_slopes_of RTI_NAME_(rti_slopes_of)
#define rti_canvas RTI_NAME_(rti_canvas)
#define rti_last_t RTI_NAME_(rti_last_t)
#define rti_choose_packets RTI_NAME_(rti_choose_packets)
#define rti_note_hits RTI_NAME_(rti_note_hits)
#define rti_cover_queue RTI_NAME_(rti_cover_queue)
#define rti_cover RTI_NAME_(rti_cover)
#if RTI_IN(HOST)
#if RTI_LANES == RTI_LANES_ARRAY            /* a loop for each operation: too long to be everywhere with -Os */
#define RTI_FN RTI_INLINE RTI_TARGET
#else
#define RTI_FN RTI_HOT RTI_TARGET
#endif
#define RTI_ALL_LANES ((1u << RTI_WIDTH) - 1)

#if RTI_LANES == RTI_LANES_FLOAT

typedef float rti_v;
typedef double rti_d;
RTI_FN rti_v rti_vset(float x) { return x; }
RTI_FN rti_v rti_vid(uint32_t id) { float f; memcpy(&f, &id, sizeof f); return f; }
RTI_FN rti_v rti_vload(const float *p) { return *p; }
RTI_FN void rti_vstore(float *p, rti_v a) { *p = a; }
RTI_FN rti_v rti_vadd(rti_v a, rti_v b) { return a + b; }
RTI_FN rti_v rti_vsub(rti_v a, rti_v b) { return a - b; }
RTI_FN rti_v rti_vmul(rti_v a, rti_v b) { return a * b; }
RTI_FN rti_v rti_vdiv(rti_v a, rti_v b) { return a / b; }
#if RTI_FMA
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return fmaf(a, b, c); }
#else
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return a * b + c; }
#endif
RTI_FN rti_v rti_vmin(rti_v a, rti_v b) { return a < b ? a : b; }
RTI_FN rti_v rti_vmax(rti_v a, rti_v b) { return a > b ? a : b; }
RTI_FN rti_v rti_vabs(rti_v a) { return fabsf(a); }
RTI_FN rti_v rti_vsign(rti_v size, rti_v sign) { return copysignf(size, sign); }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { return a < b; }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { return a <= b; }
RTI_FN unsigned rti_vnegative(rti_v a) { uint32_t bits; memcpy(&bits, &a, sizeof bits); return bits >> 31; }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b) { return lanes ? a : b; }
RTI_FN rti_v rti_vround(rti_v a) { return rti_roundf(a); }
#if RTI_FMA
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { return org * rdir; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org_rdir, rti_v rdir) { return fmaf(plane, rdir, -org_rdir); }
#else
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { (void)rdir; return org; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org, rti_v rdir) { return (plane - org) * rdir; }
#endif
RTI_FN rti_d rti_dset(double x) { return x; }
RTI_FN rti_d rti_dload(const double *p) { return *p; }
RTI_FN void rti_dstore(double *p, rti_d a) { *p = a; }
RTI_FN rti_d rti_dadd(rti_d a, rti_d b) { return a + b; }
RTI_FN rti_d rti_dsub(rti_d a, rti_d b) { return a - b; }
RTI_FN rti_d rti_dmul(rti_d a, rti_d b) { return a * b; }
RTI_FN rti_d rti_ddiv(rti_d a, rti_d b) { return a / b; }
RTI_FN rti_d rti_dsqrt(rti_d a) { return sqrt(a); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b) { return a < b; }
RTI_FN rti_d rti_dmin(rti_d a, rti_d b) { return a < b ? a : b; }
RTI_FN rti_d rti_dmax(rti_d a, rti_d b) { return a > b ? a : b; }
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b) { return lanes ? a : b; }
RTI_FN rti_d rti_widen(rti_v a) { return (double)a; }
RTI_FN rti_v rti_narrow(rti_d a) { return (float)a; }
RTI_FN rti_d rti_product(rti_d a, rti_d b) { return rti_round(a * b); }

#elif RTI_LANES == RTI_LANES_ARRAY

typedef struct { float f[RTI_WIDTH]; } rti_v;
typedef struct { double f[RTI_WIDTH]; } rti_d;
#define RTI_EACH(type, expression) type r; int i; for (i = 0; i < RTI_WIDTH; i++) r.f[i] = (expression); return r
#define RTI_BITS(expression) unsigned r = 0; int i; for (i = 0; i < RTI_WIDTH; i++) r |= (unsigned)(expression) << i; return r
RTI_FN rti_v rti_vset(float x) { RTI_EACH(rti_v, x); }
RTI_FN rti_v rti_vid(uint32_t id) { float f; memcpy(&f, &id, sizeof f); { RTI_EACH(rti_v, f); } }
RTI_FN rti_v rti_vload(const float *p) { RTI_EACH(rti_v, p[i]); }
RTI_FN void rti_vstore(float *p, rti_v a) { memcpy(p, a.f, sizeof a.f); }
RTI_FN rti_v rti_vadd(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] + b.f[i]); }
RTI_FN rti_v rti_vsub(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] - b.f[i]); }
RTI_FN rti_v rti_vmul(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] * b.f[i]); }
RTI_FN rti_v rti_vdiv(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] / b.f[i]); }
RTI_FN rti_v rti_vmin(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] < b.f[i] ? a.f[i] : b.f[i]); }
RTI_FN rti_v rti_vmax(rti_v a, rti_v b) { RTI_EACH(rti_v, a.f[i] > b.f[i] ? a.f[i] : b.f[i]); }
RTI_FN rti_v rti_vabs(rti_v a) { RTI_EACH(rti_v, fabsf(a.f[i])); }
RTI_FN rti_v rti_vsign(rti_v size, rti_v sign) { RTI_EACH(rti_v, copysignf(size.f[i], sign.f[i])); }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { RTI_BITS(a.f[i] < b.f[i]); }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { RTI_BITS(a.f[i] <= b.f[i]); }
RTI_FN unsigned rti_vnegative(rti_v a) { uint32_t bits[RTI_WIDTH]; memcpy(bits, a.f, sizeof bits); { RTI_BITS(bits[i] >> 31); } }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b) { RTI_EACH(rti_v, lanes >> i & 1 ? a.f[i] : b.f[i]); }
RTI_FN rti_v rti_vround(rti_v a) { RTI_EACH(rti_v, rti_roundf(a.f[i])); }
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { (void)rdir; return org; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org, rti_v rdir) { RTI_EACH(rti_v, (plane.f[i] - org.f[i]) * rdir.f[i]); }
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { RTI_EACH(rti_v, a.f[i] * b.f[i] + c.f[i]); }
RTI_FN rti_v rti_vquad(float x, float y, float z, float w) { const float q[4] = { x, y, z, w }; { RTI_EACH(rti_v, q[i % 4]); } }
RTI_FN float rti_vleast(rti_v a)
{
    float least = a.f[0];
    int i;
    for (i = 1; i < RTI_WIDTH; i++) least = a.f[i] < least ? a.f[i] : least;
    return least;
}
RTI_FN float rti_vmost(rti_v a)
{
    float most = a.f[0];
    int i;
    for (i = 1; i < RTI_WIDTH; i++) most = a.f[i] > most ? a.f[i] : most;
    return most;
}
RTI_FN rti_v rti_vleasts(const rti_v a[RTI_WIDTH]) { RTI_EACH(rti_v, rti_vleast(a[i])); }
RTI_FN bool rti_vapart(rti_v a, rti_v b)
{
    float least = a.f[0], most = b.f[0];
    int i;
    for (i = 1; i < 4; i++) {
        least = a.f[i] < least ? a.f[i] : least;
        most = b.f[i] > most ? b.f[i] : most;
    }
    return least < most;
}
RTI_FN rti_d rti_dset(double x) { RTI_EACH(rti_d, x); }
RTI_FN rti_d rti_dload(const double *p) { RTI_EACH(rti_d, p[i]); }
RTI_FN void rti_dstore(double *p, rti_d a) { memcpy(p, a.f, sizeof a.f); }
RTI_FN rti_d rti_dadd(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] + b.f[i]); }
RTI_FN rti_d rti_dsub(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] - b.f[i]); }
RTI_FN rti_d rti_dmul(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] * b.f[i]); }
RTI_FN rti_d rti_ddiv(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] / b.f[i]); }
RTI_FN rti_d rti_dsqrt(rti_d a) { RTI_EACH(rti_d, sqrt(a.f[i])); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b) { RTI_BITS(a.f[i] < b.f[i]); }
RTI_FN rti_d rti_dmin(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] < b.f[i] ? a.f[i] : b.f[i]); }
RTI_FN rti_d rti_dmax(rti_d a, rti_d b) { RTI_EACH(rti_d, a.f[i] > b.f[i] ? a.f[i] : b.f[i]); }
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b) { RTI_EACH(rti_d, lanes >> i & 1 ? a.f[i] : b.f[i]); }
RTI_FN rti_d rti_widen(rti_v a) { RTI_EACH(rti_d, (double)a.f[i]); }
RTI_FN rti_v rti_narrow(rti_d a) { RTI_EACH(rti_v, (float)a.f[i]); }
RTI_FN rti_d rti_product(rti_d a, rti_d b) { RTI_EACH(rti_d, rti_round(a.f[i] * b.f[i])); }
#undef RTI_EACH
#undef RTI_BITS

#elif RTI_LANES == RTI_LANES_SSE2

typedef __m128 rti_v;
typedef struct { __m128d lo, hi; } rti_d;
#define RTI_BOTH(expression_lo, expression_hi) rti_d r; r.lo = (expression_lo); r.hi = (expression_hi); return r
RTI_FN rti_v rti_vset(float x) { return _mm_set1_ps(x); }
RTI_FN rti_v rti_vid(uint32_t id) { return _mm_castsi128_ps(_mm_set1_epi32((int)id)); }
RTI_FN rti_v rti_vload(const float *p) { return _mm_loadu_ps(p); }
RTI_FN void rti_vstore(float *p, rti_v a) { _mm_storeu_ps(p, a); }
RTI_FN rti_v rti_vadd(rti_v a, rti_v b) { return _mm_add_ps(a, b); }
RTI_FN rti_v rti_vsub(rti_v a, rti_v b) { return _mm_sub_ps(a, b); }
RTI_FN rti_v rti_vmul(rti_v a, rti_v b) { return _mm_mul_ps(a, b); }
RTI_FN rti_v rti_vdiv(rti_v a, rti_v b) { return _mm_div_ps(a, b); }
RTI_FN rti_v rti_vmin(rti_v a, rti_v b) { return _mm_min_ps(a, b); }
RTI_FN rti_v rti_vmax(rti_v a, rti_v b) { return _mm_max_ps(a, b); }
RTI_FN rti_v rti_vabs(rti_v a) { return _mm_andnot_ps(_mm_set1_ps(-0.0f), a); }
RTI_FN rti_v rti_vsign(rti_v size, rti_v sign) { return _mm_or_ps(size, _mm_and_ps(_mm_set1_ps(-0.0f), sign)); }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { return (unsigned)_mm_movemask_ps(_mm_cmplt_ps(a, b)); }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { return (unsigned)_mm_movemask_ps(_mm_cmple_ps(a, b)); }
RTI_FN unsigned rti_vnegative(rti_v a) { return (unsigned)_mm_movemask_ps(a); }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b)
{
    __m128i bit = _mm_set_epi32(8, 4, 2, 1);
    __m128 mask = _mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32((int)lanes), bit), bit));
    return _mm_or_ps(_mm_and_ps(mask, a), _mm_andnot_ps(mask, b));
}
RTI_FN rti_v rti_vround(rti_v a) { RTI_ROUND(a); return a; }
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { (void)rdir; return org; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org, rti_v rdir) { return _mm_mul_ps(_mm_sub_ps(plane, org), rdir); }
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return _mm_add_ps(_mm_mul_ps(a, b), c); }
RTI_FN rti_v rti_vquad(float x, float y, float z, float w) { return _mm_set_ps(w, z, y, x); }
RTI_FN float rti_vleast(rti_v a)
{
    a = _mm_min_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_min_ss(a, _mm_shuffle_ps(a, a, 1)));
}
RTI_FN float rti_vmost(rti_v a)
{
    a = _mm_max_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_max_ss(a, _mm_shuffle_ps(a, a, 1)));
}
RTI_FN rti_v rti_vleasts(const rti_v a[4])
{
    const __m128 x = _mm_min_ps(_mm_unpacklo_ps(a[0], a[1]), _mm_unpackhi_ps(a[0], a[1]));
    const __m128 y = _mm_min_ps(_mm_unpacklo_ps(a[2], a[3]), _mm_unpackhi_ps(a[2], a[3]));
    return _mm_min_ps(_mm_movelh_ps(x, y), _mm_movehl_ps(y, x));
}
RTI_FN bool rti_vapart(rti_v a, rti_v b)
{
    __m128 least = a, most = b;
    least = _mm_min_ps(least, _mm_movehl_ps(least, least));
    most = _mm_max_ps(most, _mm_movehl_ps(most, most));
    least = _mm_min_ss(least, _mm_shuffle_ps(least, least, 1));
    most = _mm_max_ss(most, _mm_shuffle_ps(most, most, 1));
    return _mm_comilt_ss(least, most) != 0;
}
RTI_FN rti_d rti_dset(double x) { RTI_BOTH(_mm_set1_pd(x), _mm_set1_pd(x)); }
RTI_FN rti_d rti_dload(const double *p) { RTI_BOTH(_mm_loadu_pd(p), _mm_loadu_pd(p + 2)); }
RTI_FN void rti_dstore(double *p, rti_d a) { _mm_storeu_pd(p, a.lo); _mm_storeu_pd(p + 2, a.hi); }
RTI_FN rti_d rti_dadd(rti_d a, rti_d b) { RTI_BOTH(_mm_add_pd(a.lo, b.lo), _mm_add_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dsub(rti_d a, rti_d b) { RTI_BOTH(_mm_sub_pd(a.lo, b.lo), _mm_sub_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dmul(rti_d a, rti_d b) { RTI_BOTH(_mm_mul_pd(a.lo, b.lo), _mm_mul_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_ddiv(rti_d a, rti_d b) { RTI_BOTH(_mm_div_pd(a.lo, b.lo), _mm_div_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dsqrt(rti_d a) { RTI_BOTH(_mm_sqrt_pd(a.lo), _mm_sqrt_pd(a.hi)); }
RTI_FN rti_d rti_dmin(rti_d a, rti_d b) { RTI_BOTH(_mm_min_pd(a.lo, b.lo), _mm_min_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dmax(rti_d a, rti_d b) { RTI_BOTH(_mm_max_pd(a.lo, b.lo), _mm_max_pd(a.hi, b.hi)); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b)
{
    return (unsigned)_mm_movemask_pd(_mm_cmplt_pd(a.lo, b.lo)) | (unsigned)_mm_movemask_pd(_mm_cmplt_pd(a.hi, b.hi)) << 2;
}
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b)
{
    __m128i bit = _mm_set_epi32(2, 2, 1, 1), lo = _mm_set1_epi32((int)lanes), hi = _mm_set1_epi32((int)(lanes >> 2));
    __m128d mlo = _mm_castsi128_pd(_mm_cmpeq_epi32(_mm_and_si128(lo, bit), bit));
    __m128d mhi = _mm_castsi128_pd(_mm_cmpeq_epi32(_mm_and_si128(hi, bit), bit));
    RTI_BOTH(_mm_or_pd(_mm_and_pd(mlo, a.lo), _mm_andnot_pd(mlo, b.lo)), _mm_or_pd(_mm_and_pd(mhi, a.hi), _mm_andnot_pd(mhi, b.hi)));
}
RTI_FN rti_d rti_widen(rti_v a) { RTI_BOTH(_mm_cvtps_pd(a), _mm_cvtps_pd(_mm_movehl_ps(a, a))); }
RTI_FN rti_v rti_narrow(rti_d a) { return _mm_movelh_ps(_mm_cvtpd_ps(a.lo), _mm_cvtpd_ps(a.hi)); }
RTI_FN rti_d rti_product(rti_d a, rti_d b)
{
    rti_d r = rti_dmul(a, b);
    RTI_ROUND(r.lo);
    RTI_ROUND(r.hi);
    return r;
}
#undef RTI_BOTH

#else /* RTI_LANES_AVX2 */

typedef __m256 rti_v;
typedef struct { __m256d lo, hi; } rti_d;
#define RTI_BOTH(expression_lo, expression_hi) rti_d r; r.lo = (expression_lo); r.hi = (expression_hi); return r
RTI_FN rti_v rti_vset(float x) { return _mm256_set1_ps(x); }
RTI_FN rti_v rti_vid(uint32_t id) { return _mm256_castsi256_ps(_mm256_set1_epi32((int)id)); }
RTI_FN rti_v rti_vload(const float *p) { return _mm256_loadu_ps(p); }
RTI_FN void rti_vstore(float *p, rti_v a) { _mm256_storeu_ps(p, a); }
RTI_FN rti_v rti_vadd(rti_v a, rti_v b) { return _mm256_add_ps(a, b); }
RTI_FN rti_v rti_vsub(rti_v a, rti_v b) { return _mm256_sub_ps(a, b); }
RTI_FN rti_v rti_vmul(rti_v a, rti_v b) { return _mm256_mul_ps(a, b); }
RTI_FN rti_v rti_vdiv(rti_v a, rti_v b) { return _mm256_div_ps(a, b); }
RTI_FN rti_v rti_vmin(rti_v a, rti_v b) { return _mm256_min_ps(a, b); }
RTI_FN rti_v rti_vmax(rti_v a, rti_v b) { return _mm256_max_ps(a, b); }
RTI_FN rti_v rti_vabs(rti_v a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a); }
RTI_FN rti_v rti_vsign(rti_v size, rti_v sign) { return _mm256_or_ps(size, _mm256_and_ps(_mm256_set1_ps(-0.0f), sign)); }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LT_OQ)); }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)); }
RTI_FN unsigned rti_vnegative(rti_v a) { return (unsigned)_mm256_movemask_ps(a); }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b)
{
    __m256i bit = _mm256_set_epi32(128, 64, 32, 16, 8, 4, 2, 1);
    return _mm256_blendv_ps(b, a, _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((int)lanes), bit), bit)));
}
RTI_FN rti_v rti_vround(rti_v a) { RTI_ROUND(a); return a; }
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { return _mm256_mul_ps(org, rdir); }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org_rdir, rti_v rdir) { return _mm256_fmsub_ps(plane, rdir, org_rdir); }
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return _mm256_fmadd_ps(a, b, c); }
RTI_FN rti_v rti_vquad(float x, float y, float z, float w) { return _mm256_set_ps(w, z, y, x, w, z, y, x); }
RTI_FN float rti_vleast(rti_v a)
{
    __m128 x = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    x = _mm_min_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_min_ss(x, _mm_shuffle_ps(x, x, 1)));
}
RTI_FN float rti_vmost(rti_v a)
{
    __m128 x = _mm_max_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    x = _mm_max_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_max_ss(x, _mm_shuffle_ps(x, x, 1)));
}
RTI_FN rti_v rti_vleasts(const rti_v a[8])
{
    __m256 x[4];
    int i;
    RTI_UNROLL
    for (i = 0; i < 4; i++) x[i] = _mm256_min_ps(_mm256_unpacklo_ps(a[2 * i], a[2 * i + 1]), _mm256_unpackhi_ps(a[2 * i], a[2 * i + 1]));
    RTI_UNROLL
    for (i = 0; i < 4; i += 2) x[i] = _mm256_min_ps(_mm256_shuffle_ps(x[i], x[i + 1], 0x44), _mm256_shuffle_ps(x[i], x[i + 1], 0xee));
    return _mm256_min_ps(_mm256_permute2f128_ps(x[0], x[2], 0x20), _mm256_permute2f128_ps(x[0], x[2], 0x31));
}
RTI_FN bool rti_vapart(rti_v a, rti_v b)
{
    __m128 least = _mm256_castps256_ps128(a), most = _mm256_castps256_ps128(b);
    least = _mm_min_ps(least, _mm_movehl_ps(least, least));
    most = _mm_max_ps(most, _mm_movehl_ps(most, most));
    least = _mm_min_ss(least, _mm_shuffle_ps(least, least, 1));
    most = _mm_max_ss(most, _mm_shuffle_ps(most, most, 1));
    return _mm_comilt_ss(least, most) != 0;
}
RTI_FN rti_d rti_dset(double x) { RTI_BOTH(_mm256_set1_pd(x), _mm256_set1_pd(x)); }
RTI_FN rti_d rti_dload(const double *p) { RTI_BOTH(_mm256_loadu_pd(p), _mm256_loadu_pd(p + 4)); }
RTI_FN void rti_dstore(double *p, rti_d a) { _mm256_storeu_pd(p, a.lo); _mm256_storeu_pd(p + 4, a.hi); }
RTI_FN rti_d rti_dadd(rti_d a, rti_d b) { RTI_BOTH(_mm256_add_pd(a.lo, b.lo), _mm256_add_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dsub(rti_d a, rti_d b) { RTI_BOTH(_mm256_sub_pd(a.lo, b.lo), _mm256_sub_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dmul(rti_d a, rti_d b) { RTI_BOTH(_mm256_mul_pd(a.lo, b.lo), _mm256_mul_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_ddiv(rti_d a, rti_d b) { RTI_BOTH(_mm256_div_pd(a.lo, b.lo), _mm256_div_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dsqrt(rti_d a) { RTI_BOTH(_mm256_sqrt_pd(a.lo), _mm256_sqrt_pd(a.hi)); }
RTI_FN rti_d rti_dmin(rti_d a, rti_d b) { RTI_BOTH(_mm256_min_pd(a.lo, b.lo), _mm256_min_pd(a.hi, b.hi)); }
RTI_FN rti_d rti_dmax(rti_d a, rti_d b) { RTI_BOTH(_mm256_max_pd(a.lo, b.lo), _mm256_max_pd(a.hi, b.hi)); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b)
{
    return (unsigned)_mm256_movemask_pd(_mm256_cmp_pd(a.lo, b.lo, _CMP_LT_OQ)) |
        (unsigned)_mm256_movemask_pd(_mm256_cmp_pd(a.hi, b.hi, _CMP_LT_OQ)) << 4;
}
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b)
{
    __m256i bit = _mm256_set_epi64x(8, 4, 2, 1);
    __m256i lo = _mm256_set1_epi64x((long long)lanes), hi = _mm256_set1_epi64x((long long)(lanes >> 4));
    RTI_BOTH(_mm256_blendv_pd(b.lo, a.lo, _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(lo, bit), bit))),
             _mm256_blendv_pd(b.hi, a.hi, _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(hi, bit), bit))));
}
RTI_FN rti_d rti_widen(rti_v a) { RTI_BOTH(_mm256_cvtps_pd(_mm256_castps256_ps128(a)), _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1))); }
RTI_FN rti_v rti_narrow(rti_d a)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm256_cvtpd_ps(a.lo)), _mm256_cvtpd_ps(a.hi), 1);
}
RTI_FN rti_d rti_product(rti_d a, rti_d b)
{
    rti_d r = rti_dmul(a, b);
    RTI_ROUND(r.lo);
    RTI_ROUND(r.hi);
    return r;
}
#undef RTI_BOTH

#endif

/* ---- >>boxes -------------------------------------------------------------------------------------------------------- */

#endif
#if RTI_IN(PASS)

/* RTI_WIDTH rays side by side, what traversal needs of them, and their hits so far. Large packets hold many: what box tests read comes
   first, what few tests read last. */
RTI_SHARED(
typedef struct {
    float rdir[3][RTI_WIDTH];                               /* 1 / dir, bounded */
    float tmin[RTI_WIDTH], t[RTI_WIDTH];                    /* t: of the hit; starts as tmax */
)
#if defined(RTI_WIDTH) && RTI_WIDTH > 1
    float slope[2][RTI_WIDTH];                              /* of large packets: dir along u and v, over dir along k */
#endif
RTI_SHARED(
    float shear[2][RTI_WIDTH];                              /* dir[kx] / dir[kz], dir[ky] / dir[kz] */
    double rdepth[RTI_WIDTH];                               /* 1 / dir[kz] */
    float u[RTI_WIDTH], v[RTI_WIDTH];
    union { uint32_t id[RTI_WIDTH]; float bits[RTI_WIDTH]; } prim, inst;   /* bits: to select them like floats */
    unsigned axis[3];                                       /* lanes whose kz is that axis, */
    int first_axis, last_axis;                              /* and which axes have any */
    int side[3];                                            /* uniform directions: 1 where upper planes are met first */
    bool uniform;
)
#if defined(RTI_WIDTH) && RTI_WIDTH > 1
    unsigned live, found;                                   /* of large packets: lanes that still need hits, and that have one */
#endif
RTI_SHARED(
    float org[3][RTI_WIDTH], dir[3][RTI_WIDTH];
    float time[RTI_WIDTH];                                  /* where the accel moves */
    float plane[2][3][RTI_WIDTH];                           /* rti_vorigin of org: padded, for lower and upper planes; in
                                                               large packets not padded, and the first alone */
    float pad[RTI_WIDTH];                                   /* how far planes are moved out */
)
#if RTI_INSTANCES && RTI_KDTREE
RTI_SHARED(
    uint32_t seen[RTI_SEEN], seen_by[RTI_SEEN], next_seen;  /* instances of a k-d tree that were traced last, and by which lanes */
)
#endif
RTI_SHARED(
} RTI_ALIGNED(RTI_WIDTH >= 8 ? 64 : 32) rti_packet;
)

RTI_SHARED(
RTI_FN void rti_no_hits(rti_packet *p)
{
    rti_vstore(p->u, rti_vset(0));
    rti_vstore(p->v, rti_vset(0));
    rti_vstore(p->prim.bits, rti_vset(0));
    rti_vstore(p->inst.bits, rti_vset(0));
}
)

/* What the primitive tests need to know of directions; answers the lanes of legal whose largest component, which it tells, is large
   enough. */
RTI_SHARED(
RTI_FN unsigned rti_orient(rti_packet *p, const rti_v dir[3], unsigned legal, rti_v *largest)
{
    const unsigned y_over_x = rti_vlt(rti_vabs(dir[0]), rti_vabs(dir[1]));
    const rti_v x_or_y = rti_vmax(rti_vabs(dir[0]), rti_vabs(dir[1]));
    const unsigned z_over = rti_vlt(x_or_y, rti_vabs(dir[2]));
    rti_v depth;
    *largest = rti_vmax(x_or_y, rti_vabs(dir[2]));
    legal &= rti_vle(rti_vset(RT_MIN_DIRECTION), *largest);
    if (!legal) return 0;
    p->axis[2] = z_over;
    p->axis[1] = y_over_x & ~z_over;
    p->axis[0] = RTI_ALL_LANES & ~(y_over_x | z_over);
    p->first_axis = p->axis[0] & legal ? 0 : p->axis[1] & legal ? 1 : 2;
    p->last_axis = p->axis[2] & legal ? 2 : p->axis[1] & legal ? 1 : 0;
    depth = rti_vselect(z_over, dir[2], rti_vselect(y_over_x, dir[1], dir[0]));
    rti_vstore(p->shear[0], rti_vdiv(rti_vselect(z_over, dir[0], rti_vselect(y_over_x, dir[2], dir[1])), depth));
    rti_vstore(p->shear[1], rti_vdiv(rti_vselect(z_over, dir[1], rti_vselect(y_over_x, dir[0], dir[2])), depth));
    rti_dstore(p->rdepth, rti_ddiv(rti_dset(1), rti_widen(depth)));
    return legal;
}
)

/* The least that a component of dir counts as, see rti_prepare. */
RTI_SHARED(
RTI_FN rti_v rti_least(rti_v reach, rti_v far_org, rti_v largest)
{
    return rti_vmax(rti_vmul(largest, rti_vset(2.98023224e-08f)), rti_vmul(rti_vadd(reach, far_org), rti_vset(1e-37f)));
}
)

/* How far planes are moved out, see rti_prepare; clamp: the least over the largest component. */
RTI_SHARED(
RTI_FN rti_v rti_pad(const rt_accel *accel, rti_v reach, rti_v far_org, rti_v clamp, rti_v largest)
{
    rti_v slack, pad;
    slack = rti_vmul(rti_vset(accel->spread * 5.9604644775390625e-08f), rti_vadd(far_org, rti_vset(accel->extent)));
    slack = rti_vadd(slack, rti_vmul(far_org, rti_vset(2.384185791015625e-07f)));                   /* 4 e |org| */
    pad = rti_vadd(rti_vset(9.5367431640625e-07f), rti_vmul(rti_vset(2), clamp));                  /* 16 e, and the clamp */
    pad = rti_vadd(rti_vmul(rti_vadd(reach, slack), pad), slack);
    return rti_vadd(pad, rti_vmul(rti_vadd(largest, rti_vset(1)), rti_vset(1e-37f)));              /* of the smallest floats */
}
)

/* Also notes on which side of boxes the legal rays enter. */
RTI_SHARED(
RTI_FN rti_v rti_invert_dir(rti_packet *p, int k, rti_v dir, rti_v least, unsigned legal)
{
    const rti_v rdir = rti_vdiv(rti_vset(1), rti_vsign(rti_vmax(rti_vabs(dir), least), dir));
    const unsigned negative = rti_vnegative(dir) & legal;
    rti_vstore(p->rdir[k], rdir);
    p->side[k] = negative != 0;
    if (negative && negative != legal) p->uniform = false;
    return rdir;
}
)

/* Fills what follows from org, dir, tmin, t; answers the lanes that hold a legal ray.

   No box test may lose a hit that the primitive test finds, in whatever order boxes come. What has to be covered, with e = 2^-24 and R
   the largest distance from org to a plane of the root box: the sheared vertices of [Woop] move by up to 8 e R sideways, the plane
   distances and their products by 3 e R, t by e R; those sum to 12 e R. So lower planes are moved out by 16 e R, and upper planes
   likewise: since org - plane is what counts, by moving org. Rounding of that sum, and of org * rdir where the test is an fma, are 2 e
   |org|; 4 are added. Instances add what rti_set_reach says. That is [Ize]'s idea as an absolute bound, which holds for t of any sign,
   and at vertices too.

   Directions smaller than least count as least: so nothing overflows and no 0 * inf appears. The ray then errs by at most R * least /
   largest on its way to a hit, and R is slack more for what lies outside its box: in instances, and in spheres too small to widen a box
   that far away. Twice that is added, since for the shortest rays least is much larger than largest, and then pad is all there is, its own
   rounding included. Near zero errors stop being relative: coordinates and t then err by a few of the smallest normal float (also with
   flush-to-zero), t times the direction in space.

   large: for a large packet, which has one pad for all and keeps no padded planes. */
RTI_SHARED(
RTI_FN unsigned rti_prepare(const rt_accel *accel, rti_packet *p, unsigned lanes, const bool large)
{
    rti_v org[3], dir[3], reach = rti_vset(0), far_org = rti_vset(0), largest, least, pad;
    unsigned legal = lanes & rti_vlt(rti_vload(p->tmin), rti_vload(p->t));
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        rti_v lo, hi;
        org[k] = rti_vload(p->org[k]);
        dir[k] = rti_vload(p->dir[k]);
        legal &= rti_vle(rti_vabs(org[k]), rti_vset(RT_MAX_COORDINATE)) & rti_vle(rti_vabs(dir[k]), rti_vset(RT_MAX_DIRECTION));
        lo = rti_vabs(rti_vsub(rti_vset(accel->lower[k]), org[k]));
        hi = rti_vabs(rti_vsub(rti_vset(accel->upper[k]), org[k]));
        reach = rti_vmax(rti_vmax(lo, hi), reach);
        far_org = rti_vmax(rti_vabs(org[k]), far_org);
    }
    legal = rti_orient(p, dir, legal, &largest);
    if (!legal) return 0;

    least = rti_least(reach, far_org, largest);
    pad = rti_pad(accel, reach, far_org, rti_vdiv(least, largest), largest);
    rti_vstore(p->pad, pad);
    p->uniform = true;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const rti_v rdir = rti_invert_dir(p, k, dir[k], least, legal);
        if (large) {                        /* the same pad for all: see rti_make_door */
            rti_vstore(p->plane[0][k], rti_vorigin(org[k], rdir));
            continue;
        }
        rti_vstore(p->plane[0][k], rti_vorigin(rti_vadd(org[k], pad), rdir));
        rti_vstore(p->plane[1][k], rti_vorigin(rti_vsub(org[k], pad), rdir));
    }
    return legal;
}
)

/* The packet's constants of the box test, in registers where they fit. With uniform directions near and far planes are known
   beforehand; else both planes of an axis are tested and sorted. */
RTI_SHARED(
typedef struct { rti_v rdir, near_org, far_org; int near_plane, far_plane; } rti_slab;
typedef struct { rti_slab x, y, z; rti_v tmin; bool uniform; } rti_slabs;
)

RTI_SHARED(
RTI_FN rti_slab rti_make_slab(const rti_packet *p, int axis, bool uniform)
{
    const int side = uniform ? p->side[axis] : 0;
    rti_slab s;
    s.rdir = rti_vload(p->rdir[axis]);
    s.near_org = rti_vload(p->plane[side][axis]);
    s.far_org = rti_vload(p->plane[1 - side][axis]);
    s.near_plane = 3 * side + axis;
    s.far_plane = 3 - 3 * side + axis;
    return s;
}

RTI_FN void rti_cross_slab(const rti_slab *s, const RTI_GLOBAL float *bounds, bool uniform, rti_v *enter, rti_v *leave)
{
    rti_v a = rti_vplane(rti_vset(bounds[s->near_plane]), s->near_org, s->rdir);
    rti_v b = rti_vplane(rti_vset(bounds[s->far_plane]), s->far_org, s->rdir);
    *enter = uniform ? a : rti_vmin(a, b);
    *leave = uniform ? b : rti_vmax(a, b);
}
)

/* Lanes whose ray meets the box between tmin and tmax, where they enter it and where they leave it. */
RTI_SHARED(
RTI_FN unsigned rti_hit_box(const rti_slabs *s, const RTI_GLOBAL float *bounds, rti_v tmax, rti_v *enter, rti_v *leave)
{
    rti_v x0, x1, y0, y1, z0, z1;
    if (s->uniform) {
        rti_cross_slab(&s->x, bounds, true, &x0, &x1);
        rti_cross_slab(&s->y, bounds, true, &y0, &y1);
        rti_cross_slab(&s->z, bounds, true, &z0, &z1);
    } else {
        rti_cross_slab(&s->x, bounds, false, &x0, &x1);
        rti_cross_slab(&s->y, bounds, false, &y0, &y1);
        rti_cross_slab(&s->z, bounds, false, &z0, &z1);
    }
    *enter = rti_vmax(rti_vmax(x0, y0), rti_vmax(z0, s->tmin));
    *leave = rti_vmin(rti_vmin(x1, y1), rti_vmin(z1, tmax));
    return rti_vle(*enter, *leave);
}
)

RTI_SHARED(
RTI_FN rti_slabs rti_make_slabs(const rti_packet *p)
{
    rti_slabs s;
    s.uniform = RTI_KNOWN_SIDES(p);
    s.tmin = rti_vload(p->tmin);
    s.x = rti_make_slab(p, 0, s.uniform);
    s.y = rti_make_slab(p, 1, s.uniform);
    s.z = rti_make_slab(p, 2, s.uniform);
    return s;
}
)

/* ---- >>primitives --------------------------------------------------------------------------------------------------- */

/* Takes those of lanes whose t counts: RT_ANY just answers them; else they become the hit where they are closest. */
RTI_SHARED(
RTI_FN unsigned rti_accept(rti_packet *p, unsigned lanes, rti_v t, rti_v u, rti_v v, uint32_t prim, uint32_t inst, int flags)
{
    rti_v best = rti_vload(p->t);
    unsigned closer = lanes & rti_vlt(rti_vload(p->tmin), t) & rti_vle(t, best), ties = closer & ~rti_vlt(t, best);
    if (RTI_UNLIKELY(ties)) {               /* at equal t the ids decide; against tmax nothing wins (its ids are 0) */
        int i;
        for (i = 0; i < RTI_WIDTH; i++)
            if (ties >> i & 1 && (flags & RTI_WALK_ANY || inst > p->inst.id[i] || (inst == p->inst.id[i] && prim >= p->prim.id[i])))
                closer &= ~(1u << i);
    }
    if (!closer || flags & RTI_WALK_ANY) return closer;
    rti_vstore(p->t, rti_vselect(closer, t, best));
    rti_vstore(p->u, rti_vselect(closer, u, rti_vload(p->u)));
    rti_vstore(p->v, rti_vselect(closer, v, rti_vload(p->v)));
    rti_vstore(p->prim.bits, rti_vselect(closer, rti_vid(prim), rti_vload(p->prim.bits)));
    rti_vstore(p->inst.bits, rti_vselect(closer, rti_vid(inst), rti_vload(p->inst.bits)));
    return closer;
}
)

/* Edge function a x b of two sheared vertices. Rounding is monotonic, so its sign is right or it is 0. */
RTI_SHARED(
RTI_FN rti_v rti_edge(rti_v ax, rti_v ay, rti_v bx, rti_v by)
{
    return rti_vsub(rti_vround(rti_vmul(ax, by)), rti_vround(rti_vmul(ay, bx)));
}
)

/* The same in double: the products of floats are exact, the difference is rounded once. */
RTI_SHARED(
RTI_FN rti_d rti_edge_exact(rti_v ax, rti_v ay, rti_v bx, rti_v by)
{
    return rti_dsub(rti_dmul(rti_widen(ax), rti_widen(by)), rti_dmul(rti_widen(ay), rti_widen(bx)));
}
)

/* What the triangle test needs of those rays of a packet whose largest component is kz. */
RTI_SHARED(
typedef struct { int kx, ky, kz; rti_v ox, oy, oz, sx, sy; } rti_shear;

RTI_FN rti_shear rti_make_shear(const rti_packet *p, int kz)
{
    rti_shear s;
    s.kz = kz;
    s.kx = kz == 2 ? 0 : kz + 1;
    s.ky = s.kx == 2 ? 0 : s.kx + 1;
    s.ox = rti_vload(p->org[s.kx]);
    s.oy = rti_vload(p->org[s.ky]);
    s.oz = rti_vload(p->org[kz]);
    s.sx = rti_vload(p->shear[0]);
    s.sy = rti_vload(p->shear[1]);
    return s;
}
)

/* What rti_hit_triangle decides, from sheared vertices a, b, c and their coordinates along kz; t, u, v of the lanes that it answers. */
RTI_SHARED(
RTI_FN unsigned rti_decide(unsigned hit, rti_v ax, rti_v ay, rti_v bx, rti_v by, rti_v cx, rti_v cy, rti_v az, rti_v bz, rti_v cz, rti_v oz,
                           rti_d rdepth, rti_v *t, rti_v *u, rti_v *v)
{
    const rti_d ud = rti_edge_exact(cx, cy, bx, by), vd = rti_edge_exact(ax, ay, cx, cy), wd = rti_edge_exact(bx, by, ax, ay);
    /* some are below 0 or some above: with both the ray passes outside; with neither the triangle is seen edge-on */
    hit &= rti_dlt(rti_dmin(rti_dmin(ud, vd), wd), rti_dset(0)) ^ rti_dlt(rti_dset(0), rti_dmax(rti_dmax(ud, vd), wd));
    if (hit) {
        const rti_d depth = rti_widen(oz), rdet = rti_ddiv(rti_dset(1), rti_dadd(rti_dadd(ud, vd), wd));
        rti_d td = rti_dadd(rti_product(ud, rti_dsub(rti_widen(az), depth)), rti_product(vd, rti_dsub(rti_widen(bz), depth)));
        td = rti_dadd(td, rti_product(wd, rti_dsub(rti_widen(cz), depth)));
        *t = rti_narrow(rti_dmul(rti_dmul(td, rdet), rdepth));
        *u = rti_narrow(rti_dmul(vd, rdet));
        *v = rti_narrow(rti_dmul(wd, rdet));
    }
    return hit;
}
)

/* [Woop]: axes permuted so that kz is the ray's largest, org moved to the origin, sheared so that the ray is the z axis. A vertex becomes
   a 2D point that depends on ray and vertex alone, so triangles which share it agree about it to the last bit: nothing slips through.
   Float edge functions throw out most triangles; zeros, which may be wrong, count as inside. What is left is decided again, and its t, u,
   v computed, in double: exact signs, and weights that are good even for slivers and triangles seen edge-on. a: the vertices,
   whose coordinates stand stride apart.
   RTI_WALK_LIKELY leaves the floats out, for those who have thrown out most triangles themselves. */
RTI_SHARED(
RTI_FN unsigned rti_hit_triangle(rti_packet *p, const rti_shear *s, unsigned live, const RTI_GLOBAL float *a, const int stride, uint32_t prim,
                                 uint32_t inst, int flags)
{
    const int kx = stride * s->kx, ky = stride * s->ky, kz = stride * s->kz, b = 3 * stride, c = 6 * stride;
    const rti_v az = rti_vsub(rti_vset(a[kz]), s->oz);
    const rti_v bz = rti_vsub(rti_vset(a[b + kz]), s->oz);
    const rti_v cz = rti_vsub(rti_vset(a[c + kz]), s->oz);
    const rti_v ax = rti_vsub(rti_vsub(rti_vset(a[kx]), s->ox), rti_vround(rti_vmul(s->sx, az)));
    const rti_v ay = rti_vsub(rti_vsub(rti_vset(a[ky]), s->oy), rti_vround(rti_vmul(s->sy, az)));
    const rti_v bx = rti_vsub(rti_vsub(rti_vset(a[b + kx]), s->ox), rti_vround(rti_vmul(s->sx, bz)));
    const rti_v by = rti_vsub(rti_vsub(rti_vset(a[b + ky]), s->oy), rti_vround(rti_vmul(s->sy, bz)));
    const rti_v cx = rti_vsub(rti_vsub(rti_vset(a[c + kx]), s->ox), rti_vround(rti_vmul(s->sx, cz)));
    const rti_v cy = rti_vsub(rti_vsub(rti_vset(a[c + ky]), s->oy), rti_vround(rti_vmul(s->sy, cz)));
    unsigned hit = live;
    if (!(flags & RTI_WALK_LIKELY)) {
        const rti_v u = rti_edge(cx, cy, bx, by), v = rti_edge(ax, ay, cx, cy), w = rti_edge(bx, by, ax, ay);
        hit &= ~(rti_vlt(rti_vmin(rti_vmin(u, v), w), rti_vset(0)) & rti_vlt(rti_vset(0), rti_vmax(rti_vmax(u, v), w)));
    }
    if (hit) {
        rti_v t, u, v;
        hit = rti_decide(hit, ax, ay, bx, by, cx, cy, rti_vset(a[kz]), rti_vset(a[b + kz]), rti_vset(a[c + kz]), s->oz, rti_dload(p->rdepth), &t, &u, &v);
        if (hit) return rti_accept(p, hit, t, u, v, prim, inst, flags);
    }
    return 0;
}
)

RTI_SHARED(
RTI_FN unsigned rti_hit_triangles(const rt_accel *accel, rti_packet *p, unsigned lanes, const RTI_GLOBAL uint32_t *slots, uint32_t first,
                                  uint32_t count, uint32_t inst, int flags)
{
    const uint32_t last = first + count;
    unsigned found = 0;
    int kz;
    for (kz = p->first_axis; kz <= p->last_axis; kz++) {
        unsigned live = lanes & p->axis[kz], hit;
        rti_shear shear;
        uint32_t i;
        if (!live) continue;
        shear = rti_make_shear(p, kz);
        for (i = first; i < last && live; i++) {
            float gathered[9];
            uint32_t prim;
            const RTI_GLOBAL float *corners = rti_corners(accel, rti_slot(slots, i), gathered, &prim);
            found |= hit = rti_hit_triangle(p, &shear, live, corners, 1, prim, inst, flags);
            if (flags & RTI_WALK_ANY) live &= ~hit;
        }
    }
    return found;
}
)

#if RTI_SPHERES || RTI_PLANES
RTI_SHARED(
RTI_FN rti_d rti_dot_exact(const rti_d a[3], const rti_d b[3])
{
    return rti_dadd(rti_dadd(rti_product(a[0], b[0]), rti_product(a[1], b[1])), rti_product(a[2], b[2]));
}
)

#endif
#if RTI_SPHERES
/* [Haines], in double: the discriminant from the vector between the centre and the ray's nearest point, and the roots without a
   difference of near numbers: a ray that starts on the sphere gets exactly 0. A disc above 0 is a difference of near numbers, so at
   least 2^-54 r^2: then root is large enough to keep c / q good to 2^-24 r, which the padding of the boxes covers. Where disc is 0 both
   roots are k; c / q would be noise over noise for a tangent that starts on the sphere.
   Not inlined, like instances: the two in every walk were a fifth of the code, and no faster. */
RTI_SHARED(
RTI_NOINLINE RTI_TARGET unsigned rti_hit_spheres(const rt_accel *accel, rti_packet *p, unsigned lanes,
                                                 const RTI_GLOBAL uint32_t *slots, uint32_t first, uint32_t count, uint32_t inst, int flags)
{
    unsigned found = 0;
    uint32_t i;
    for (i = first; i < first + count; i++) {
        const rti_ball ball = rti_ball_at(accel, rti_slot(slots, i));
        rti_d to[3], dir[3], off[3], a, along, k, disc, root, c, q, at;
        rti_v tn, tf;
        unsigned hit, ahead, crosses;
        int axis;
        for (axis = 0; axis < 3; axis++) {
            to[axis] = rti_dsub(rti_dset((double)ball.center[axis]), rti_widen(rti_vload(p->org[axis])));
            dir[axis] = rti_widen(rti_vload(p->dir[axis]));
        }
        a = rti_dot_exact(dir, dir);
        along = rti_dot_exact(to, dir);
        k = rti_ddiv(along, a);
        for (axis = 0; axis < 3; axis++) off[axis] = rti_dsub(to[axis], rti_product(k, dir[axis]));
        disc = rti_dsub(rti_product(rti_dset((double)ball.radius), rti_dset((double)ball.radius)), rti_dot_exact(off, off));
        hit = lanes & ~rti_dlt(disc, rti_dset(0));
        if (!hit) continue;
        root = rti_dsqrt(rti_dmul(a, disc));
        c = rti_dsub(rti_dot_exact(to, to), rti_product(rti_dset((double)ball.radius), rti_dset((double)ball.radius)));
        ahead = ~rti_dlt(along, rti_dset(0)) & RTI_ALL_LANES;
        q = rti_dselect(ahead, rti_dadd(along, root), rti_dsub(along, root));
        at = rti_ddiv(q, a);
        c = rti_ddiv(c, q);
        crosses = rti_dlt(rti_dset(0), disc);
        tn = rti_narrow(rti_dselect(crosses, rti_dselect(ahead, c, at), k));
        tf = rti_narrow(rti_dselect(crosses, rti_dselect(ahead, at, c), k));
        found |= hit = rti_accept(p, hit, rti_vselect(rti_vlt(rti_vload(p->tmin), tn), tn, tf), rti_vset(0), rti_vset(0), ball.prim, inst,
                                  flags);
        if (flags & RTI_WALK_ANY && !(lanes &= ~hit)) break;
    }
    return found;
}
)
#endif

#if RTI_PLANES
/* Ground outside of the tree ([Lohr] 4). In double, where no product of floats leaves the range; a ray along a plane gets an infinity or no
   number, which count as no hit. */
RTI_SHARED(
RTI_NOINLINE RTI_TARGET unsigned rti_hit_planes(const rt_accel *accel, rti_packet *p, unsigned lanes, uint32_t inst, const rti_job *job)
{
    const int flags = (job->query == RT_ANY ? RTI_WALK_ANY : 0) | (RTI_COUNTS(job) ? RTI_WALK_COUNT : 0);
    unsigned found = 0;
    size_t i;
    RTI_TALLY(job->stats, flags, prims, (uint64_t)accel->plane_count * (uint64_t)rti_bit_count(lanes));
    for (i = 0; i < accel->plane_count && lanes; i++) {
        const RTI_GLOBAL rti_ground *plane = &accel->planes[i];
        rti_d to[3], dir[3], normal[3], t;
        unsigned hit = lanes;
        int k;
        for (k = 0; k < 3; k++) {
            to[k] = rti_dsub(rti_dset((double)plane->point[k]), rti_widen(rti_vload(p->org[k])));
            dir[k] = rti_widen(rti_vload(p->dir[k]));
            normal[k] = rti_dset((double)plane->normal[k]);
        }
        t = rti_ddiv(rti_dot_exact(normal, to), rti_dot_exact(normal, dir));
        if (plane->radius > 0) {
            const rti_d radius = rti_dset((double)plane->radius);
            rti_d off[3];
            for (k = 0; k < 3; k++) off[k] = rti_dsub(rti_product(t, dir[k]), to[k]);
            hit &= ~rti_dlt(rti_product(radius, radius), rti_dot_exact(off, off));
        }
        hit = hit ? rti_accept(p, hit, rti_narrow(t), rti_vset(0), rti_vset(0), plane->prim, inst, flags) : 0;
        found |= hit;
        if (flags & RTI_WALK_ANY) lanes &= ~hit;
    }
    return found;
}
)
#endif

#if RTI_INSTANCES
/* The rays as they go on in object space, a packet of their own; t means the same there. Answers the lanes that are legal there. */
RTI_SHARED(
RTI_NOINLINE RTI_TARGET unsigned rti_enter_instance(const rti_instance *in, const rt_accel *child, const rti_packet *p,
                                                    unsigned lanes, rti_packet *inner, bool large)
{
    int i, k;
    for (i = 0; i < RTI_WIDTH; i++) {
        float org[3], dir[3], to_org[3], to_dir[3];
        for (k = 0; k < 3; k++) {
            org[k] = p->org[k][i];
            dir[k] = p->dir[k][i];
        }
        if (in->moves) rti_move_back(&in->motion, p->time[i], org, dir);
        if (child->moves) inner->time[i] = p->time[i];
        rti_transform_ray(in->inverse, org, dir, to_org, to_dir);
        for (k = 0; k < 3; k++) {
            inner->org[k][i] = to_org[k];
            inner->dir[k][i] = to_dir[k];
        }
        inner->tmin[i] = p->tmin[i];
        inner->t[i] = p->t[i];
        inner->u[i] = p->u[i];
        inner->v[i] = p->v[i];
    }
    inner->prim = p->prim;
    inner->inst = p->inst;
    return rti_prepare(child, inner, lanes, large);
}
)

/* Takes over what the lanes of hit have found there. */
RTI_SHARED(
RTI_FN void rti_leave_instance(rti_packet *p, const rti_packet *inner, unsigned hit)
{
    int i;
    for (i = 0; i < RTI_WIDTH; i++)
        if (hit >> i & 1) {
            p->t[i] = inner->t[i];
            p->u[i] = inner->u[i];
            p->v[i] = inner->v[i];
            p->prim.id[i] = inner->prim.id[i];
            p->inst.id[i] = inner->inst.id[i];
        }
}
)

#endif
#endif
#if RTI_IN(HOST)
#define rti_walk_child rti_walk
typedef unsigned (*rti_walker)(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job);      /* of live lanes, at least one */
RTI_NOINLINE RTI_TARGET unsigned rti_walk(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job);
#endif
#if RTI_IN(INSTANCES) && RTI_INSTANCES
RTI_SHARED(
RTI_NOINLINE RTI_TARGET unsigned rti_hit_instances(const rt_accel *accel, rti_packet *p, unsigned lanes,
                                                   const RTI_GLOBAL uint32_t *slots, uint32_t first, uint32_t count, uint32_t inst,
                                                   const rti_job *job)
{
    unsigned found = 0;
    uint32_t n;
    for (n = first; n < first + count; n++) {
        const uint32_t slot = rti_slot(slots, n);
        const rti_instance in = accel->instances[slot];
        unsigned todo = lanes;
        rti_packet inner;
        unsigned legal, hit;
        RTI_OPEN(child, accel, in.accel);
)
#if RTI_KDTREE
RTI_SHARED(
        if (accel->structure == RT_KDTREE) {    /* in several leaves: while it is among the last RTI_SEEN, each ray goes through it once */
            int at = 0;
            while (at < RTI_SEEN && p->seen[at] != slot) at++;
            if (at == RTI_SEEN) {
                at = (int)(p->next_seen++ % RTI_SEEN);
                p->seen[at] = slot;
                p->seen_by[at] = 0;
            }
            todo &= ~p->seen_by[at];
            p->seen_by[at] |= todo;
            if (!todo) continue;
        }
)
#endif
RTI_SHARED(
        legal = rti_enter_instance(&in, child, p, todo, &inner, false);
        if (!legal) continue;
        hit = rti_walk_child(child, &inner, legal, inst + 1 + in.base, job);
        found |= hit;
        if (job->query == RT_ANY) {
            if (!(lanes &= ~hit)) break;
        } else rti_leave_instance(p, &inner, hit);
    }
    return found;
}
)
#endif

/* ---- >>traverse ----------------------------------------------------------------------------------------------------- */

#if RTI_IN(LEAF)
/* The primitives of a leaf: slots[first...], or, slots being NULL, slots first...; kind and their number are packed in count. */
RTI_SHARED(
RTI_FN unsigned rti_hit_leaf(const rt_accel *accel, rti_packet *p, unsigned lanes, const RTI_GLOBAL uint32_t *slots, uint32_t first,
                             uint32_t count, uint32_t inst, const int flags, const rti_job *job)
{
    const uint32_t kind = count >> RTI_KIND_SHIFT, n = count & RTI_COUNT_MASK;
    (void)job;
    (void)kind;
    RTI_TALLY(job->stats, flags, prims, n * (uint32_t)rti_bit_count(lanes));
    if (!(flags & RTI_WALK_ALL) || kind == RTI_TRIANGLE) return rti_hit_triangles(accel, p, lanes, slots, first, n, inst, flags);
)
#if RTI_SPHERES
RTI_SHARED(
    if (kind == RTI_SPHERE) return rti_hit_spheres(accel, p, lanes, slots, first, n, inst, flags);
)
#endif
#if RTI_INSTANCES
RTI_SHARED(
    if (kind == RTI_INSTANCE) return rti_hit_instances(accel, p, lanes, slots, first, n, inst, job);
)
#endif
RTI_SHARED(
    return 0;
}
)

#endif
#if RTI_IN(HOST) && (RTI_KDTREE || RTI_THREADED)
#if RTI_SPHERES || RTI_INSTANCES
/* Spheres or instances; in code of their own, which triangles would have to save registers for. */
RTI_NOINLINE RTI_TARGET unsigned rti_hit_others(const rt_accel *accel, rti_packet *p, unsigned lanes, const uint32_t *slots, uint32_t first,
                                                uint32_t count, uint32_t inst, const rti_job *job)
{
    const uint32_t n = count & RTI_COUNT_MASK;
    (void)n;
#if RTI_INSTANCES
    if (count >> RTI_KIND_SHIFT == RTI_INSTANCE) return rti_hit_instances(accel, p, lanes, slots, first, n, inst, job);
#endif
#if RTI_SPHERES
    if (job->query == RT_ANY) return rti_hit_spheres(accel, p, lanes, slots, first, n, inst, RTI_WALK_ANY);
    return rti_hit_spheres(accel, p, lanes, slots, first, n, inst, 0);
#else
    return 0;
#endif
}
#endif

/* Any primitives of one kind; not inlined, since a copy in every walk would be most of the code. */
RTI_NOINLINE RTI_TARGET unsigned rti_hit_run(const rt_accel *accel, rti_packet *p, unsigned lanes, const uint32_t *slots, uint32_t first,
                                             uint32_t count, uint32_t inst, const rti_job *job)
{
#if RTI_SPHERES || RTI_INSTANCES
    if (RTI_UNLIKELY(count >> RTI_KIND_SHIFT != RTI_TRIANGLE)) return rti_hit_others(accel, p, lanes, slots, first, count, inst, job);
#endif
    if (job->query == RT_ANY) return rti_hit_leaf(accel, p, lanes, slots, first, count, inst, RTI_WALK_ANY, job);
    return rti_hit_leaf(accel, p, lanes, slots, first, count, inst, 0, job);
}

#endif
#if RTI_IN(BVH)
/* Depth first, near child first, the far child on a stack with where each ray enters it. Answers the lanes that hit something.
   A box entered at just the t of the best hit is still visited: what is in it may have a lower id. */
RTI_SHARED(
RTI_FN unsigned rti_walk_body(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const int flags, const rti_job *job)
{
    struct { const RTI_GLOBAL rti_node *node; rti_v enter; } stack[RTI_STACK];
    unsigned stack_lanes[RTI_STACK];
    const RTI_GLOBAL rti_node *const nodes = accel->nodes, *node = nodes;
    const rti_slabs s = rti_make_slabs(p);
    unsigned found = 0, lanes = live;
    int top = 0;
    (void)job;
    for (;;) {
        while (!node->count) {
            const RTI_GLOBAL rti_node *child = nodes + node->index;
            rti_v best = rti_vload(p->t), enter0, enter1, leave;
            unsigned hit0 = rti_hit_box(&s, child->bounds, best, &enter0, &leave) & live;
            unsigned hit1 = rti_hit_box(&s, child[1].bounds, best, &enter1, &leave) & live;
            unsigned both = hit0 & hit1;
            RTI_TALLY(job->stats, flags, nodes, rti_bit_count(lanes));
            RTI_TALLY(job->stats, flags, boxes, 2 * rti_bit_count(lanes));
            RTI_TALLY(job->stats, flags, steps, 1);
            RTI_TALLY(job->stats, flags, active, rti_bit_count(lanes));
            if (hit0) {                     /* branches, not selects: a predicted child is fetched before its box is known to be hit */
                if (hit1) {                 /* the first ray in both decides which is near */
                    RT_ASSERT(top < RTI_STACK);
                    if (RTI_WIDTH == 1 ? rti_vlt(enter1, enter0) : both & (0u - both) & rti_vlt(enter1, enter0)) {
                        stack[top].enter = enter0;
                        stack[top].node = child;
                        if (RTI_WIDTH > 1) stack_lanes[top] = hit0;
                        node = child + 1;
                        lanes = hit1;
                    } else {
                        stack[top].enter = enter1;
                        stack[top].node = child + 1;
                        if (RTI_WIDTH > 1) stack_lanes[top] = hit1;
                        node = child;
                        lanes = hit0;
                    }
                    top++;
                    RTI_TALLY(job->stats, flags, pushes, 1);
                } else {
                    node = child;
                    lanes = hit0;
                }
            } else if (hit1) {
                node = child + 1;
                lanes = hit1;
            } else goto pop;
        }
        {
            const unsigned hit = rti_hit_leaf(accel, p, lanes, NULL, node->index, node->count, inst, flags, job);
            RTI_TALLY(job->stats, flags, leaves, rti_bit_count(lanes));
            found |= hit;
            if (flags & RTI_WALK_ANY && !(live &= ~hit)) return found;
        }
pop:
        do {
            if (!top) return found;
            top--;
            lanes = RTI_WIDTH > 1 ? stack_lanes[top] & live : live;
            if (!(flags & RTI_WALK_ANY)) lanes &= rti_vle(stack[top].enter, rti_vload(p->t));
        } while (!lanes);
        node = stack[top].node;
    }
}
)

#endif
#if RTI_IN(HOST) && RTI_BVH
#define RTI_WALK(name, constants)                                                                                              \
    RTI_NOINLINE RTI_TARGET unsigned name(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job) \
    {                                                                                                                          \
        return rti_walk_body(accel, p, live, inst, constants, job);                                                          \
    }
RTI_WALK(rti_walk_closest, 0)
RTI_WALK(rti_walk_any, RTI_WALK_ANY)
#if RTI_SPHERES || RTI_INSTANCES
RTI_WALK(rti_walk_closest_all, RTI_WALK_ALL)
RTI_WALK(rti_walk_any_all, RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#if RTI_STATS
RTI_WALK(rti_walk_closest_count, RTI_WALK_COUNT | RTI_WALK_ALL)
RTI_WALK(rti_walk_any_count, RTI_WALK_COUNT | RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#undef RTI_WALK
#endif

#if RTI_KDTREE

/* [Horn] A.1 to A.5 in two bodies: with a stack that holds every node that waits, and without one or with a short one, which restarts.
   What differs from the paper, since its pseudo-code loses hits where rounding matters:

   planes    A ray crosses a plane not at one t but from lo to hi, between which it is nearer to the plane than rounding can tell (the
             pad of rti_prepare). The near child is left at hi and the far one entered at lo: a ray in the plane, or through an edge of
             four cells, sees the cells on both sides of it. Comparisons are closed: cells of no depth are visited. That leaves no hit
             out, since a hit is as near to some point of its primitive, and the cell around that point has the primitive in its leaf.
   restarts  The paper goes on at tMin = the last leaf's tMax. Where intervals overlap that skips leaves; where the last leaf has no depth
             it never ends. We keep which way we went: a bit a level, path, set for the far child, and another, open, where the far child
             waits. To restart is to walk path again down to the deepest open level ([Laine]'s trail): the same nodes as the
             paper's, no leaf twice and none left out.
   early exit  A hit ends the search when it is nearer than where every node that waits is entered, not than the leaf's end: a hit in
             another cell, found early, is good, and ties are left to those that wait.
   packets   A lane is live where tmin <= tmax: masks follow from the intervals ([Horn] A.5 keeps them apart). Lanes whose ray goes the
             other way than the first one's have near and far swapped; order does not matter to closest hits, only to speed. */

#if RTI_IN(KD)
RTI_SHARED(
typedef struct { const RTI_GLOBAL rti_kdnode *node; rti_v tmin, tmax; } rti_kdstate;

/* What a ray needs to cross planes, by axis. */
typedef struct {
    struct {
        rti_v rdir, near_org, far_org;
        unsigned backward;                  /* lanes that meet the second child first */
    } axis[3];
    unsigned sides;                         /* bit a: along axis a the upper child is first */
    bool uniform;                           /* no lane goes backward */
} rti_kdray;
)

/* Fills r, and at with the root and where the rays are in its box; answers the lanes that are. Not inlined: once a ray. */
RTI_SHARED(
RTI_NOINLINE RTI_TARGET unsigned rti_kd_begin(const rt_accel *accel, rti_packet *p, unsigned live, rti_kdray *r, rti_kdstate *at)
{
    int k;
    r->uniform = true;
    r->sides = 0;
    at->node = accel->kdnodes;
    at->tmin = rti_vload(p->tmin);
    at->tmax = rti_vload(p->t);
    for (k = 0; k < 3; k++) {
        const rti_v dir = rti_vload(p->dir[k]), lower = rti_vload(p->plane[0][k]), upper = rti_vload(p->plane[1][k]);
        const rti_v rdir = rti_vload(p->rdir[k]);
        const rti_v a = rti_vplane(rti_vset(accel->lower[k]), lower, rdir), b = rti_vplane(rti_vset(accel->upper[k]), upper, rdir);
        const unsigned negative = rti_vnegative(dir), first = live & (0u - live);
        r->axis[k].rdir = rdir;
        if (negative & first) r->sides |= 1u << k;
        r->axis[k].near_org = rti_vselect(negative, upper, lower);
        r->axis[k].far_org = rti_vselect(negative, lower, upper);
        r->axis[k].backward = negative & first ? ~negative & RTI_ALL_LANES : negative;
        if (r->axis[k].backward & live) r->uniform = false;
        at->tmin = rti_vmax(rti_vmin(a, b), at->tmin);
        at->tmax = rti_vmin(rti_vmax(a, b), at->tmax);
    }
)
#if RTI_INSTANCES
RTI_SHARED(
    for (k = 0; k < RTI_SEEN && accel->slots[RTI_INSTANCE]; k++) p->seen[k] = RT_NONE;
    p->next_seen = 0;
)
#endif
RTI_SHARED(
    return live & rti_vle(at->tmin, at->tmax);
}
)

/* The same, to what the walk keeps in registers: whose address it must not give away. */
RTI_SHARED(
RTI_FN unsigned rti_kd_enter(const rt_accel *accel, rti_packet *p, unsigned live, rti_kdray *r, rti_kdstate *at)
{
    rti_kdray ray;
    rti_kdstate root;
    live = rti_kd_begin(accel, p, live, &ray, &root);
    *r = ray;
    *at = root;
    return live;
}
)

/* Splits the interval [tmin, tmax] at a node's plane between its first and its second child. Answers whether any live lane wants the
   first (1) and the second (2); nobody wants an empty one. */
RTI_SHARED(
RTI_FN unsigned rti_kd_cross(const rti_kdray *r, const RTI_GLOBAL rti_kdnode *nodes, const rti_kdstate *at, unsigned live, rti_kdstate *first,
                        rti_kdstate *second)
{
    const uint32_t word = at->node->word, axis = word & 3;
    const uint32_t side = r->sides >> axis & 1;           /* from a register: a load would double the time from node to node */
    const RTI_GLOBAL rti_kdnode *pair =             /* 2 nodes are 16 bytes */
        (const RTI_GLOBAL rti_kdnode *)(const RTI_GLOBAL void *)((const RTI_GLOBAL char *)nodes + (word & ~15u));
    const rti_v lo = rti_vplane(rti_vset(at->node->as.split), r->axis[axis].near_org, r->axis[axis].rdir);
    const rti_v hi = rti_vplane(rti_vset(at->node->as.split), r->axis[axis].far_org, r->axis[axis].rdir);
    const rti_v until = rti_vmin(hi, at->tmax), from = rti_vmax(lo, at->tmin);
    first->node = pair + side;
    second->node = pair + (side ^ 1);
    if (RTI_WIDTH == 1 || r->uniform) {
        first->tmin = at->tmin;
        first->tmax = until;
        second->tmin = from;
        second->tmax = at->tmax;
    } else {
        const unsigned backward = r->axis[axis].backward;
        first->tmin = rti_vselect(backward, from, at->tmin);
        first->tmax = rti_vselect(backward, at->tmax, until);
        second->tmin = rti_vselect(backward, at->tmin, from);
        second->tmax = rti_vselect(backward, until, at->tmax);
    }
    if (word & RTI_KD_EMPTY) {              /* every other node: the plane just cuts the interval */
        if ((word & RTI_KD_LOWER_EMPTY) == (side ? RTI_KD_LOWER_EMPTY : 0)) return rti_vle(first->tmin, first->tmax) & live ? 1 : 0;
        return rti_vle(second->tmin, second->tmax) & live ? 2 : 0;
    }
    if (!(rti_vle(second->tmin, second->tmax) & live)) return 1;
    return rti_vle(first->tmin, first->tmax) & live ? 3 : 2;
}
)

/* The short stack, a ring: a push on a full one drops its oldest entry. lost is where the first of the dropped is entered. */
RTI_SHARED(
typedef struct {
    struct { rti_kdstate state; int level; } entry[RTI_SHORT_STACK];
    int entries, held, top;                 /* its size, how many it holds, and where the next one goes */
    rti_v lost;
} rti_kdring;

RTI_FN void rti_kd_push(rti_kdring *ring, const rti_kdstate *state, int level, const int flags, const rti_job *job)
{
    (void)flags, (void)job;
    if (!ring->entries) {                   /* no stack at all: nothing is pushed */
        ring->lost = rti_vmin(ring->lost, state->tmin);
        return;
    }
    RTI_TALLY(job->stats, flags, pushes, 1);
    if (ring->held < ring->entries) ring->held++;
    else {
        ring->lost = rti_vmin(ring->lost, ring->entry[ring->top].state.tmin);
        RTI_TALLY(job->stats, flags, drops, 1);
    }
    ring->entry[ring->top].state = *state;
    ring->entry[ring->top].level = level;
    if (++ring->top == ring->entries) ring->top = 0;
}
)
#endif
#if RTI_IN(HOST)
#define RTI_KD_TALLY(at)                                                                                \
    do {                                                                                                \
        RTI_TALLY(job->stats, flags, nodes, rti_bit_count(rti_vle((at).tmin, (at).tmax) & live));       \
        RTI_TALLY(job->stats, flags, active, rti_bit_count(rti_vle((at).tmin, (at).tmax) & live));      \
        RTI_TALLY(job->stats, flags, steps, 1);                                                         \
    } while (0)
#endif

#if RTI_IN(KD_LEAF)
RTI_SHARED(
RTI_FN unsigned rti_kd_hit_leaf(const rt_accel *accel, rti_packet *p, unsigned lanes, const RTI_GLOBAL rti_kdnode *leaf, uint32_t inst,
                                const int flags, const rti_job *job)
{
    const uint32_t count = leaf->as.count, n = count & RTI_COUNT_MASK, first = n == 1 ? leaf->word >> 2 : 0;
    const RTI_GLOBAL uint32_t *const slots = n == 1 ? NULL : accel->kdslots + (leaf->word >> 2);
    RTI_TALLY(job->stats, flags, leaves, rti_bit_count(lanes));
    if (!(flags & RTI_WALK_ALL)) return rti_hit_leaf(accel, p, lanes, slots, first, count, inst, flags, job);
    RTI_TALLY(job->stats, flags, prims, n * (uint32_t)rti_bit_count(lanes));
    if (count >> RTI_KIND_SHIFT != RTI_MIXED) return rti_hit_run(accel, p, lanes, slots, first, count, inst, job);
    {
        unsigned found = 0;
        uint32_t from, to;
        for (from = 0; from < n && lanes; from = to) {          /* entries of one kind at a time */
            const uint32_t kind = slots[from] & ~RTI_COUNT_MASK;
            unsigned hit;
            for (to = from + 1; to < n && (slots[to] & ~RTI_COUNT_MASK) == kind; to++) {}
            found |= hit = rti_hit_run(accel, p, lanes, slots + from, 0, kind | (to - from), inst, job);
            if (flags & RTI_WALK_ANY) lanes &= ~hit;
        }
        return found;
    }
}
)
#endif

#if RTI_IN(KD_STACK)
RTI_SHARED(
RTI_FN unsigned rti_kd_stack_body(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const int flags, const rti_job *job)
{
    rti_kdstate stack[RTI_STACK], at, first, second;
    const RTI_GLOBAL rti_kdnode *const nodes = accel->kdnodes;
    rti_kdray r;
    unsigned found = 0, lanes;
    int top = 0;
    (void)job;
    live = rti_kd_enter(accel, p, live, &r, &at);
    if (!live) return 0;
    if (RTI_WIDTH == 1) live = 1;           /* known to be: no masks */
    for (;;) {
        while ((at.node->word & 3) != RTI_LEAF) {
            const unsigned wants = rti_kd_cross(&r, nodes, &at, live, &first, &second);
            RTI_KD_TALLY(at);
            if (wants & 1) {                /* branches, not selects: the predicted child is fetched early */
                if (wants & 2) {
                    RT_ASSERT(top < RTI_STACK);
                    stack[top++] = second;
                    RTI_TALLY(job->stats, flags, pushes, 1);
                }
                at = first;
            } else if (wants) at = second;
            else goto pop;
        }
        lanes = rti_vle(at.tmin, at.tmax) & live;
        {
            const unsigned hit = rti_kd_hit_leaf(accel, p, lanes, at.node, inst, flags, job);
            found |= hit;
            if (flags & RTI_WALK_ANY && !(live &= ~hit)) return found;
        }
pop:
        do {
            if (!top) return found;
            at = stack[--top];
            if (!(flags & RTI_WALK_ANY)) at.tmax = rti_vmin(at.tmax, rti_vload(p->t));
        } while (!(rti_vle(at.tmin, at.tmax) & live));
    }
}
)
#endif

#if RTI_IN(KD_RESTART)
/* RT_KD_RESTART and RT_KD_PUSHDOWN, whose stack has no entries; RT_KD_SHORTSTACK; and, for single rays, RT_KD_BACKTRACK, which climbs to
   where the others restart. base is where restarts begin: the root or, but for RT_KD_RESTART, the lowest node that has nothing waiting
   above it. */
RTI_SHARED(
RTI_FN unsigned rti_kd_restart_body(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const int flags,
                                    const rti_job *job)
{
    rti_kdring ring;
    rti_kdstate at, first, second, base;
    const RTI_GLOBAL rti_kdnode *const nodes = accel->kdnodes;
    rti_kdray r;
    const bool push_down = job->algorithm != RT_KD_RESTART, backtrack = RTI_WIDTH == 1 && job->algorithm == RT_KD_BACKTRACK;
    uint64_t path = 0, open = 0;            /* bit l: at level l */
    unsigned found = 0, lanes;
    int level = 0, base_level = 0;
    ring.entries = job->entries;
    ring.held = ring.top = 0;
    ring.lost = rti_vset(RTI_INFINITY);
    live = rti_kd_enter(accel, p, live, &r, &at);
    if (!live) return 0;
    if (RTI_WIDTH == 1) live = 1;           /* known to be: no masks */
    base = at;
    for (;;) {
        while ((at.node->word & 3) != RTI_LEAF) {
            const uint64_t bit = (uint64_t)1 << level;
            const unsigned wants = rti_kd_cross(&r, nodes, &at, live, &first, &second);
            RTI_KD_TALLY(at);
            level++;
            if (wants & 1) {
                if (wants & 2) {
                    open |= bit;
                    rti_kd_push(&ring, &second, level, flags, job);
                }
                at = first;
            } else if (wants) {
                path |= bit;
                at = second;
            } else {
                at.node = first.node;       /* of this level, where backtracking starts */
                goto next;
            }
            if (push_down && !open) {
                base = at;
                base_level = level;
            }
        }
        lanes = rti_vle(at.tmin, at.tmax) & live;
        {
            const unsigned hit = rti_kd_hit_leaf(accel, p, lanes, at.node, inst, flags, job);
            found |= hit;
            if (flags & RTI_WALK_ANY && !(live &= ~hit)) return found;
        }
next:
        do {
            const rti_v best = rti_vload(p->t);
            if (ring.held) {
                ring.held--;
                ring.top = (ring.top ? ring.top : ring.entries) - 1;
                at = ring.entry[ring.top].state;
                level = ring.entry[ring.top].level;
                at.tmax = rti_vmin(at.tmax, best);
                open &= ~((uint64_t)1 << (level - 1));
                path = (path & (((uint64_t)1 << (level - 1)) - 1)) | (uint64_t)1 << (level - 1);
            } else {
                uint64_t bit;
                int next;
                if (!open || !(rti_vle(ring.lost, best) & live)) return found;
                next = 1 + rti_highest_bit(open);
                bit = (uint64_t)1 << (next - 1);
                open &= ~bit;
                path = (path & (bit - 1)) | bit;
                if (backtrack) {            /* lost stays: what waits above is not pushed again */
                    const rti_slabs s = rti_make_slabs(p);
                    uint32_t i = (uint32_t)(at.node - nodes);
                    for (; level >= next; level--) {
                        i = accel->kdlinks[i / 2].parent;
                        RTI_TALLY(job->stats, flags, nodes, 1);
                    }
                    at.node = nodes + i;
                    (void)rti_hit_box(&s, accel->kdlinks[at.node->word >> RTI_KD_PAIR].bounds, best, &at.tmin, &at.tmax);
                } else {
                    RTI_TALLY(job->stats, flags, restarts, 1);
                    at = base;
                    level = base_level;
                    ring.lost = rti_vset(RTI_INFINITY);
                }
                at.tmax = rti_vmin(at.tmax, best);
                while (level < next) {      /* path again, to the far child at its end */
                    bit = (uint64_t)1 << level;
                    (void)rti_kd_cross(&r, nodes, &at, live, &first, &second);
                    RTI_KD_TALLY(at);
                    level++;
                    if (path & bit) at = second;
                    else {
                        if (open & bit) rti_kd_push(&ring, &second, level, flags, job);
                        at = first;
                    }
                    if (push_down && !(open & (bit | (bit - 1)))) {
                        base = at;
                        base_level = level;
                    }
                }
            }
        } while (!(rti_vle(at.tmin, at.tmax) & live));
    }
}
)
#endif

#if RTI_IN(HOST)
#define RTI_KD_WALK(name, body, constants)                                                                                       \
    RTI_NOINLINE RTI_TARGET unsigned name(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job) \
    {                                                                                                                            \
        return body(accel, p, live, inst, constants, job);                                                                       \
    }
RTI_KD_WALK(rti_kd_stack_closest, rti_kd_stack_body, 0)
RTI_KD_WALK(rti_kd_stack_any, rti_kd_stack_body, RTI_WALK_ANY)
RTI_KD_WALK(rti_kd_restart_closest, rti_kd_restart_body, 0)
RTI_KD_WALK(rti_kd_restart_any, rti_kd_restart_body, RTI_WALK_ANY)
#if RTI_SPHERES || RTI_INSTANCES
RTI_KD_WALK(rti_kd_stack_closest_all, rti_kd_stack_body, RTI_WALK_ALL)
RTI_KD_WALK(rti_kd_stack_any_all, rti_kd_stack_body, RTI_WALK_ALL | RTI_WALK_ANY)
RTI_KD_WALK(rti_kd_restart_closest_all, rti_kd_restart_body, RTI_WALK_ALL)
RTI_KD_WALK(rti_kd_restart_any_all, rti_kd_restart_body, RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#if RTI_STATS
RTI_KD_WALK(rti_kd_stack_closest_count, rti_kd_stack_body, RTI_WALK_COUNT | RTI_WALK_ALL)
RTI_KD_WALK(rti_kd_stack_any_count, rti_kd_stack_body, RTI_WALK_COUNT | RTI_WALK_ALL | RTI_WALK_ANY)
RTI_KD_WALK(rti_kd_restart_closest_count, rti_kd_restart_body, RTI_WALK_COUNT | RTI_WALK_ALL)
RTI_KD_WALK(rti_kd_restart_any_count, rti_kd_restart_body, RTI_WALK_COUNT | RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#undef RTI_KD_WALK
#undef RTI_KD_TALLY

RTI_FN rti_walker rti_kd_walker(const rt_accel *accel, const rti_job *job)
{
    const bool any = job->query == RT_ANY, stack = job->algorithm == RT_KD_STACK || (job->algorithm == RT_KD_BACKTRACK && !accel->kdlinks);
#if RTI_STATS
    if (job->stats && stack) return any ? rti_kd_stack_any_count : rti_kd_stack_closest_count;
    if (job->stats) return any ? rti_kd_restart_any_count : rti_kd_restart_closest_count;
#endif
#if RTI_SPHERES || RTI_INSTANCES
    if (accel->slots[RTI_SPHERE] || accel->slots[RTI_INSTANCE]) {
        if (stack) return any ? rti_kd_stack_any_all : rti_kd_stack_closest_all;
        return any ? rti_kd_restart_any_all : rti_kd_restart_closest_all;
    }
#endif
    if (stack) return any ? rti_kd_stack_any : rti_kd_stack_closest;
    return any ? rti_kd_restart_any : rti_kd_restart_closest;
}

#endif
#endif /* RTI_KDTREE */

#if RTI_THREADED

/* [Lohr] 4 to 6. From node to node along the links: no stack. Several packets may go together, on an either-or basis: what any of their
   rays hits is entered by all ([Lohr] 5). Which list of links they take only decides how soon near hits shorten the rays.

   A transform node, an instance whose accel is threaded too, is entered and left without a stack ([Lohr] 6): rays are transformed, and the
   walk goes on at the root of that accel. Behind its last node the number of the path, see >>instance, is the way back: it tells which
   instance of which accel was entered, that accel's leaf where to go on, and the rays there are those of the outermost accel, transformed
   again down the path, with the hits found meanwhile. */

#if RTI_IN(THREADED)
/* What the test of bounding spheres needs of the rays of a packet. Directions are scaled, so that no square leaves the floats. */
RTI_SHARED(
typedef struct { rti_v org[3], dir[3], largest, rlength2, tmin, pad; } rti_sweep;

RTI_FN rti_sweep rti_make_sweep(const rti_packet *p)
{
    const rti_v x = rti_vabs(rti_vload(p->dir[0])), y = rti_vabs(rti_vload(p->dir[1])), z = rti_vabs(rti_vload(p->dir[2]));
    rti_v rlargest, length2;
    rti_sweep s;
    int k;
    s.largest = rti_vmax(rti_vmax(x, y), z);
    rlargest = rti_vdiv(rti_vset(1), s.largest);
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        s.org[k] = rti_vload(p->org[k]);
        s.dir[k] = rti_vmul(rti_vload(p->dir[k]), rlargest);
    }
    length2 = rti_vadd(rti_vadd(rti_vmul(s.dir[0], s.dir[0]), rti_vmul(s.dir[1], s.dir[1])), rti_vmul(s.dir[2], s.dir[2]));
    s.rlength2 = rti_vdiv(rti_vset(1), length2);
    s.tmin = rti_vmul(rti_vload(p->tmin), s.largest);
    s.pad = rti_vmul(rti_vset(6), rti_vload(p->pad));
    return s;
}
)

/* Lanes whose ray comes nearer to the centre than the radius, between tmin and tmax. With e = 2^-24 and R as in rti_prepare, which is at
   least the distance over sqrt(3): the point nearest to the centre is found to within 12 e times the distance, 21 e R, and a hit lies up
   to sqrt(3) pads off its primitive: together less than 4 pads, since one is at least 16 e R. Squares err by 8 e of the radius at most, by
   which rti_set_sphere has made it larger. */
RTI_SHARED(
RTI_FN unsigned rti_meet_sphere(const rti_sweep *s, const RTI_GLOBAL float *sphere, rti_v tmax)
{
    const rti_v x = rti_vsub(rti_vset(sphere[0]), s->org[0]), y = rti_vsub(rti_vset(sphere[1]), s->org[1]);
    const rti_v z = rti_vsub(rti_vset(sphere[2]), s->org[2]), r = rti_vadd(rti_vset(sphere[3]), s->pad);
    const rti_v along = rti_vfma(x, s->dir[0], rti_vfma(y, s->dir[1], rti_vmul(z, s->dir[2])));
    const rti_v at = rti_vmin(rti_vmax(rti_vmul(along, s->rlength2), s->tmin), rti_vmul(tmax, s->largest));
    const rti_v dx = rti_vsub(x, rti_vmul(at, s->dir[0])), dy = rti_vsub(y, rti_vmul(at, s->dir[1])), dz = rti_vsub(z, rti_vmul(at, s->dir[2]));
    return rti_vle(rti_vfma(dx, dx, rti_vfma(dy, dy, rti_vmul(dz, dz))), rti_vmul(r, r));
}
)
#endif

#if RTI_IN(HOST)
#define RTI_GROUPS (RTI_WIDTH == 1 ? 1 : 16 / RTI_WIDTH)   /* packets that go together at most: 16 rays */

/* Where packets are in a threaded tree: in which accel, along which list of links. */
typedef struct {
    const rt_accel *accel;
    const rti_node *nodes;
    const rti_link *links;
    uint32_t at;                            /* the node that comes next */
    uint32_t inst;                          /* what hits on the accel's own primitives are called */
    rti_packet *p;                          /* the rays there */
    unsigned live[RTI_GROUPS];
} rti_thread_state;

/* To the first node of accel, in the order that suits the first ray, live or not: the walk comes back to where it was in that order, when
   other rays may have ended. */
RTI_FN void rti_thread_start(rti_thread_state *s, const rt_accel *accel, uint32_t inst, rti_packet *p)
{
    uint32_t order = 0;
    int i;
    for (i = 0; 1 << i < accel->orders; i++) {
        uint32_t bits;
        memcpy(&bits, &p->dir[accel->order_axes[i]][0], sizeof bits);
        order |= (bits >> 31) << i;
    }
    s->accel = accel;
    s->nodes = accel->nodes;
    s->links = accel->links + (size_t)order * accel->node_count;
    s->at = 0;
    s->inst = inst;
    s->p = p;
}

/* What the tests of bounds need of the rays. */
RTI_FN void rti_thread_aim(const rti_thread_state *s, rti_slabs *slabs, rti_sweep *sweeps, const int groups, const int flags)
{
    int g;
    for (g = 0; g < groups; g++) {
        if (groups > 1 && !s->live[g]) {    /* not prepared, since no ray goes along: only what is asked for must be sound */
            s->p[g].side[0] = s->p[g].side[1] = s->p[g].side[2] = 0;
            s->p[g].uniform = false;
        }
        if (flags & (RTI_WALK_ROUND | RTI_WALK_EITHER)) sweeps[g] = rti_make_sweep(&s->p[g]);
        if (!(flags & RTI_WALK_ROUND)) slabs[g] = rti_make_slabs(&s->p[g]);
    }
}

#if RTI_INSTANCES
/* Enters the instance in a slot with the rays of hit, which become inner. Where none is legal there, it is left at once. */
RTI_NOINLINE RTI_TARGET void rti_thread_enter(rti_thread_state *s, uint32_t slot, const unsigned *hit, rti_packet *inner, int groups)
{
    const rti_instance *in = &s->accel->instances[slot];
    unsigned all = 0;
    int g;
    for (g = 0; g < groups; g++) all |= s->live[g] = rti_enter_instance(in, in->accel, &s->p[g], hit[g], &inner[g], false);
    rti_thread_start(s, in->accel, s->inst + 1 + in->base, inner);
    if (!all) s->at = RTI_END;
}

/* Leaves the instance that the rays, inner, are in: they were outer in root, whose own hits are called inst. Answers the slot of that
   instance. */
RTI_NOINLINE RTI_TARGET uint32_t rti_thread_leave(rti_thread_state *s, const rt_accel *root, uint32_t inst, rti_packet *outer,
                                                  rti_packet *inner, const unsigned *live, int groups)
{
    const rt_accel *accel = root;
    uint32_t path = s->inst - inst - 1, slot;
    int g;
    for (g = 0; g < groups; g++) {
        rti_leave_instance(&outer[g], &inner[g], live[g]);      /* all: those that are not in this instance may have hits further out */
        s->live[g] = live[g];
    }
    for (;;) {
        const rti_family family = rti_family_of(accel);
        const rti_instance *in;
        slot = family.slots[rti_find_instance(&family, path)];
        in = &family.instances[slot];
        path = path - in->base - 1;
        if (path == RT_NONE) break;
        for (g = 0; g < groups; g++)
            s->live[g] = rti_enter_instance(in, in->accel, accel == root ? &outer[g] : &inner[g], s->live[g], &inner[g], false);
        accel = in->accel;
    }
    rti_thread_start(s, accel, s->inst - accel->instances[slot].base - 1, accel == root ? outer : inner);
    return slot;
}
#endif

/* groups packets from p on, of which live lanes go; adds those that hit something to found. */
RTI_FN void rti_thread_body(const rt_accel *root, rti_packet *p, const unsigned *live, unsigned *found, const int groups, uint32_t inst,
                            const int flags, const rti_job *job)
{
    rti_thread_state s;
    rti_slabs slabs[RTI_GROUPS];
    rti_sweep sweeps[RTI_GROUPS];
    rti_v enter, leave;
    const bool round = flags & RTI_WALK_EITHER ? root->bounds == RT_BOUNDS_SPHERES : (flags & RTI_WALK_ROUND) != 0;
#if RTI_INSTANCES
    rti_packet inner[RTI_GROUPS];
#endif
    unsigned hit[RTI_GROUPS], left = 0;
    bool moved = false;                     /* to rays that slabs and sweeps are not of */
    int g;
    (void)job, (void)inst;
    for (g = 0; g < groups; g++) left |= s.live[g] = live[g];
    if (!left) return;
    rti_thread_start(&s, root, inst, p);
    if (flags & RTI_WALK_EITHER) {          /* of a number of groups that compilers do not know: else they warn */
        memset(slabs, 0, sizeof slabs);
        memset(sweeps, 0, sizeof sweeps);
    }
    rti_thread_aim(&s, slabs, sweeps, groups, flags);
    while (left) {
        const rti_node *node = NULL;
        unsigned all = 0;
        uint32_t from = 0;
        if (s.at == RTI_END) {
#if RTI_INSTANCES
            if (flags & RTI_WALK_ALL && s.inst != inst) {       /* all that is left of the leaf comes next */
                for (g = 0; g < groups; g++) hit[g] = flags & RTI_WALK_ANY ? live[g] & ~found[g] : live[g];
                from = rti_thread_leave(&s, root, inst, p, inner, hit, groups);
                node = s.nodes + s.accel->instance_nodes[from++];
                s.at = s.links[node - s.nodes].miss;
                for (g = 0; g < groups; g++) all |= hit[g] = s.live[g];
                moved = true;
            } else
#endif
                return;
        }
        if (moved) {
            rti_thread_aim(&s, slabs, sweeps, groups, flags);
            moved = false;
        }
        if (!node) {
            do {
                const rti_link link = s.links[s.at];
                node = s.nodes + s.at;
                all = 0;
                for (g = 0; g < groups; g++) {
                    const rti_v t = rti_vload(s.p[g].t);
                    if (round) hit[g] = rti_meet_sphere(&sweeps[g], node->bounds, t) & s.live[g];
                    else hit[g] = rti_hit_box(&slabs[g], node->bounds, t, &enter, &leave) & s.live[g];
                    all |= hit[g];
                    RTI_TALLY(job->stats, flags, boxes, rti_bit_count(s.live[g]));
                    RTI_TALLY(job->stats, flags, nodes, node->count ? 0 : rti_bit_count(hit[g]));
                    RTI_TALLY(job->stats, flags, active, rti_bit_count(hit[g]));
                }
                RTI_TALLY(job->stats, flags, steps, all != 0);
                s.at = all ? link.hit : link.miss;
            } while (!(all && node->count) && s.at != RTI_END);
            if (!all || !node->count) continue;
            from = node->index;
        }
#if RTI_INSTANCES
        if (flags & RTI_WALK_ALL && rti_leaf_kind(node) == RTI_INSTANCE) {
            const uint32_t end = node->index + rti_leaf_count(node);
            for (; from < end && !moved; from++) {
                const rt_accel *child = s.accel->instances[from].accel;
                for (g = 0; g < groups; g++) RTI_TALLY(job->stats, flags, prims, rti_bit_count(hit[g]));
                if (child->structure == RT_THREADED && child->bounds == root->bounds && child->node_count) {
                    rti_thread_enter(&s, from, hit, inner, groups);
                    moved = true;
#if RTI_PLANES
                    for (g = 0; g < groups && child->plane_count; g++) {
                        const unsigned new_hits = rti_hit_planes(child, &s.p[g], s.live[g], s.inst, job);
                        found[g] |= new_hits;
                        if (flags & RTI_WALK_ANY) s.live[g] &= ~new_hits;
                    }
#endif
                } else
                    for (g = 0; g < groups; g++) {
                        const unsigned new_hits = rti_hit_instances(s.accel, &s.p[g], hit[g], NULL, from, 1, s.inst, job);
                        found[g] |= new_hits;
                        if (flags & RTI_WALK_ANY) s.live[g] &= ~new_hits, hit[g] &= ~new_hits;
                    }
            }
        } else
#endif
        {
            for (g = 0; g < groups; g++) {
                unsigned new_hits = 0;
                if (groups > 1 && !hit[g]) continue;
                if (flags & RTI_WALK_ALL) new_hits = rti_hit_run(s.accel, &s.p[g], hit[g], NULL, node->index, node->count, s.inst, job);
                else new_hits = rti_hit_leaf(s.accel, &s.p[g], hit[g], NULL, node->index, node->count, s.inst, flags, job);
                RTI_TALLY(job->stats, flags, leaves, rti_bit_count(hit[g]));
                RTI_TALLY(job->stats, flags, prims, rti_leaf_count(node) * (uint32_t)rti_bit_count(hit[g]));
                found[g] |= new_hits;
                if (flags & RTI_WALK_ANY) s.live[g] &= ~new_hits;
            }
        }
        (void)from;
        if (flags & RTI_WALK_ANY)
            for (g = 0, left = 0; g < groups; g++) left |= live[g] & ~found[g];
    }
}

#define RTI_THREAD_WALK(name, constants)                                                                                          \
    RTI_NOINLINE RTI_TARGET unsigned name(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job) \
    {                                                                                                                             \
        unsigned found = 0;                                                                                                       \
        rti_thread_body(accel, p, &live, &found, 1, inst, constants, job);                                                        \
        return found;                                                                                                             \
    }
RTI_THREAD_WALK(rti_thread_closest, 0)
RTI_THREAD_WALK(rti_thread_any, RTI_WALK_ANY)
#if RTI_SPHERES || RTI_INSTANCES
RTI_THREAD_WALK(rti_thread_closest_all, RTI_WALK_ALL)
RTI_THREAD_WALK(rti_thread_any_all, RTI_WALK_ALL | RTI_WALK_ANY)
#endif
RTI_THREAD_WALK(rti_thread_closest_round, RTI_WALK_ALL | RTI_WALK_ROUND)
RTI_THREAD_WALK(rti_thread_any_round, RTI_WALK_ALL | RTI_WALK_ROUND | RTI_WALK_ANY)
#if RTI_STATS
RTI_THREAD_WALK(rti_thread_closest_count, RTI_WALK_ALL | RTI_WALK_EITHER | RTI_WALK_COUNT)
RTI_THREAD_WALK(rti_thread_any_count, RTI_WALK_ALL | RTI_WALK_EITHER | RTI_WALK_COUNT | RTI_WALK_ANY)
#endif
#undef RTI_THREAD_WALK

RTI_FN rti_walker rti_thread_walker(const rt_accel *accel, const rti_job *job)
{
    const bool any = job->query == RT_ANY;
#if RTI_STATS
    if (job->stats) return any ? rti_thread_any_count : rti_thread_closest_count;
#endif
    if (accel->bounds == RT_BOUNDS_SPHERES) return any ? rti_thread_any_round : rti_thread_closest_round;
#if RTI_SPHERES || RTI_INSTANCES
    if (accel->slots[RTI_SPHERE] || accel->slots[RTI_INSTANCE]) return any ? rti_thread_any_all : rti_thread_closest_all;
#endif
    return any ? rti_thread_any : rti_thread_closest;
}

#if RTI_WIDTH > 1
/* Several packets together. */
RTI_NOINLINE RTI_TARGET void rti_thread_groups(const rt_accel *accel, rti_packet *p, const unsigned *live, unsigned *found, int groups,
                                               const rti_job *job)
{
    const int flags = RTI_WALK_ALL | RTI_WALK_EITHER;
#if RTI_STATS
    if (job->stats && job->query == RT_ANY)
        rti_thread_body(accel, p, live, found, groups, RT_NONE, flags | RTI_WALK_COUNT | RTI_WALK_ANY, job);
    else if (job->stats) rti_thread_body(accel, p, live, found, groups, RT_NONE, flags | RTI_WALK_COUNT, job);
    else
#endif
    if (job->query == RT_ANY) rti_thread_body(accel, p, live, found, groups, RT_NONE, flags | RTI_WALK_ANY, job);
    else rti_thread_body(accel, p, live, found, groups, RT_NONE, flags, job);
}
#endif

#endif
#endif /* RTI_THREADED */

#if RTI_IN(HOST)

/* ---- >>single ------------------------------------------------------------------------------------------------------- */

#if RTI_WIDTH > 1 && RTI_BVH

/* RT_BVH_WIDE: rays of a packet go one after the other, and each meets the boxes of a node's children, or the triangles of a leaf, RTI_WIDTH
   at a time. The test that decides is rti_hit_triangle's, with triangles in the place of rays: so the hit is the same. */

/* What tests need of one ray, in all lanes; planes: where they start in rti_wide.bounds. */
typedef struct { rti_v rdir[3], near_org[3], far_org[3], tmin; size_t near_plane[3], far_plane[3]; int lane; } rti_probe;

RTI_FN rti_probe rti_make_probe(const rti_packet *p, int lane)
{
    rti_probe r;
    int k;
    r.lane = lane;
    r.tmin = rti_vset(p->tmin[lane]);
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const int side = signbit(p->dir[k][lane]) ? 1 : 0;
        r.rdir[k] = rti_vset(p->rdir[k][lane]);
        r.near_org[k] = rti_vset(p->plane[side][k][lane]);
        r.far_org[k] = rti_vset(p->plane[1 - side][k][lane]);
        r.near_plane[k] = (size_t)(RTI_CHILDREN * (3 * side + k));
        r.far_plane[k] = (size_t)(RTI_CHILDREN * (3 - 3 * side + k));
    }
    return r;
}

/* The children that the ray meets before t, and where it enters each. */
RTI_FN unsigned rti_probe_children(const rti_probe *r, const rti_wide *node, float t, float enter[RTI_CHILDREN])
{
    unsigned hit = 0;
    int i;
    RTI_UNROLL
    for (i = 0; i < RTI_CHILDREN; i += RTI_WIDTH) {
        const float *at = node->bounds[0] + i;
        const rti_v x0 = rti_vplane(rti_vload(at + r->near_plane[0]), r->near_org[0], r->rdir[0]);
        const rti_v y0 = rti_vplane(rti_vload(at + r->near_plane[1]), r->near_org[1], r->rdir[1]);
        const rti_v z0 = rti_vplane(rti_vload(at + r->near_plane[2]), r->near_org[2], r->rdir[2]);
        const rti_v x1 = rti_vplane(rti_vload(at + r->far_plane[0]), r->far_org[0], r->rdir[0]);
        const rti_v y1 = rti_vplane(rti_vload(at + r->far_plane[1]), r->far_org[1], r->rdir[1]);
        const rti_v z1 = rti_vplane(rti_vload(at + r->far_plane[2]), r->far_org[2], r->rdir[2]);
        const rti_v first = rti_vmax(rti_vmax(x0, y0), rti_vmax(z0, r->tmin));
        const rti_v last = rti_vmin(rti_vmin(x1, y1), rti_vmin(z1, rti_vset(t)));
        rti_vstore(enter + i, first);
        hit |= rti_vle(first, last) << i;
    }
    return hit;
}

/* Takes the closest of the triangles of hit; with RT_ANY all of them will do. */
RTI_FN unsigned rti_accept_lanes(rti_packet *p, int lane, unsigned hit, rti_v t, rti_v u, rti_v v, const uint32_t *prims, uint32_t inst, int flags)
{
    const rti_v best = rti_vset(p->t[lane]);
    float ts[RTI_WIDTH], us[RTI_WIDTH], vs[RTI_WIDTH];
    unsigned found = 0;
    hit &= rti_vlt(rti_vset(p->tmin[lane]), t) & (flags & RTI_WALK_ANY ? rti_vlt(t, best) : rti_vle(t, best));
    if (!hit || flags & RTI_WALK_ANY) return hit ? 1u << lane : 0;
    rti_vstore(ts, t);
    rti_vstore(us, u);
    rti_vstore(vs, v);
    for (; hit; hit &= hit - 1) {
        const int i = rti_lowest_bit(hit);
        if (ts[i] > p->t[lane] || (ts[i] == p->t[lane] && (inst > p->inst.id[lane] || (inst == p->inst.id[lane] && prims[i] >= p->prim.id[lane]))))
            continue;
        p->t[lane] = ts[i];
        p->u[lane] = us[i];
        p->v[lane] = vs[i];
        p->prim.id[lane] = prims[i];
        p->inst.id[lane] = inst;
        found = 1u << lane;
    }
    return found;
}

/* The triangles of an octet, of which count are some: rti_hit_triangle, line by line. */
RTI_FN unsigned rti_hit_octet(rti_packet *p, int lane, const rti_octet *octet, uint32_t count, uint32_t inst, const int flags)
{
    const int kz = p->axis[2] >> lane & 1 ? 2 : p->axis[1] >> lane & 1 ? 1 : 0, kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    const rti_v ox = rti_vset(p->org[kx][lane]), oy = rti_vset(p->org[ky][lane]), oz = rti_vset(p->org[kz][lane]);
    const rti_v sx = rti_vset(p->shear[0][lane]), sy = rti_vset(p->shear[1][lane]);
    unsigned found = 0;
    uint32_t at;
    for (at = 0; at < RTI_CHILDREN && at < count; at += RTI_WIDTH) {
        const float *xs = octet->v[kx] + at, *ys = octet->v[ky] + at, *zs = octet->v[kz] + at;
        rti_v x[3], y[3], u, v, w;
        unsigned hit;
        int i;
        RTI_UNROLL
        for (i = 0; i < 3; i++) {
            const int row = 3 * RTI_CHILDREN * i;
            const rti_v z = rti_vsub(rti_vload(zs + row), oz);
            x[i] = rti_vsub(rti_vsub(rti_vload(xs + row), ox), rti_vround(rti_vmul(sx, z)));
            y[i] = rti_vsub(rti_vsub(rti_vload(ys + row), oy), rti_vround(rti_vmul(sy, z)));
        }
        u = rti_edge(x[2], y[2], x[1], y[1]);
        v = rti_edge(x[0], y[0], x[2], y[2]);
        w = rti_edge(x[1], y[1], x[0], y[0]);
        hit = ~(rti_vlt(rti_vmin(rti_vmin(u, v), w), rti_vset(0)) & rti_vlt(rti_vset(0), rti_vmax(rti_vmax(u, v), w)));
        hit &= RTI_ALL_LANES;
        if (at + RTI_WIDTH > count) hit &= (1u << (count - at)) - 1;
        if (hit) {
            rti_v t, weight[2];
            hit = rti_decide(hit, x[0], y[0], x[1], y[1], x[2], y[2], rti_vload(zs), rti_vload(zs + 3 * RTI_CHILDREN), rti_vload(zs + 6 * RTI_CHILDREN),
                             oz, rti_dset(p->rdepth[lane]), &t, &weight[0], &weight[1]);
            if (hit) found |= rti_accept_lanes(p, lane, hit, t, weight[0], weight[1], octet->prim + at, inst, flags);
            if (flags & RTI_WALK_ANY && found) return found;
        }
    }
    return found;
}

/* Where no octets are kept. */
RTI_NOINLINE RTI_TARGET void rti_gather_octet(const rt_accel *accel, uint32_t first, uint32_t count, rti_octet *octet)
{
    uint32_t i;
    int k;
    for (i = 0; i < RTI_CHILDREN; i++) {
        float room[9];
        const float *v = rti_corners(accel, first + (i < count ? i : 0), room, &octet->prim[i]);
        for (k = 0; k < 9; k++) octet->v[k][i] = v[k];
    }
}

/* From a node, or, with a count, a leaf on: depth first, the nearest child first. What waits lies on a stack, the nearest on top, and is
   looked at again only where the ray still reaches it. */
RTI_FN unsigned rti_wide_body(const rt_accel *accel, rti_packet *p, int lane, uint32_t index, uint32_t count, uint32_t inst, const int flags,
                              const rti_job *job)
{
    struct { float enter; uint32_t index, count; } stack[RTI_WIDE_STACK];
    const rti_wide *const wides = accel->wides;
    const rti_probe r = rti_make_probe(p, lane);
    unsigned found = 0;
    int top = 0;
    (void)job;
    for (;;) {
        while (!count) {
            const rti_wide *node = wides + index;
            float enter[RTI_CHILDREN];
            unsigned hit = rti_probe_children(&r, node, p->t[lane], enter);
            int i, base;
            RTI_TALLY(job->stats, flags, nodes, 1);
            RTI_TALLY(job->stats, flags, boxes, RTI_CHILDREN);
            RTI_TALLY(job->stats, flags, steps, 1);
            RTI_TALLY(job->stats, flags, active, 1);
            if (!hit) goto pop;
            i = rti_lowest_bit(hit);
            hit &= hit - 1;
            for (base = top; hit; hit &= hit - 1) {
                const int next = rti_lowest_bit(hit);
                int farther = next, at = top++;
                RTI_TALLY(job->stats, flags, pushes, 1);
                if (!(flags & RTI_WALK_ANY)) {
                    if (enter[next] < enter[i]) {
                        farther = i;
                        i = next;
                    }
                    for (; at > base && stack[at - 1].enter < enter[farther]; at--) stack[at] = stack[at - 1];
                }
                stack[at].enter = enter[farther];
                stack[at].index = node->index[farther];
                stack[at].count = node->count[farther];
            }
            index = node->index[i];
            count = node->count[i];
        }
        {
            const uint32_t kind = count >> RTI_KIND_SHIFT, n = count & RTI_COUNT_MASK;
            unsigned hit = 0;
            RTI_TALLY(job->stats, flags, leaves, 1);
            RTI_TALLY(job->stats, flags, prims, n);
            if (!(flags & RTI_WALK_ALL) || kind == RTI_TRIANGLE) {
                rti_octet gathered;
                const rti_octet *octet = &gathered;
                if (accel->octets) octet = accel->octets + index;
                else rti_gather_octet(accel, index, n, &gathered);
                hit = rti_hit_octet(p, lane, octet, n, inst, flags);
            }
#if RTI_SPHERES
            else if (kind == RTI_SPHERE) hit = rti_hit_spheres(accel, p, 1u << lane, NULL, index, n, inst, flags);
#endif
#if RTI_INSTANCES
            else hit = rti_hit_instances(accel, p, 1u << lane, NULL, index, n, inst, job);
#endif
            found |= hit;
            if (flags & RTI_WALK_ANY && hit) return found;
        }
pop:
        do {
            if (!top) return found;
            top--;
        } while (!(flags & RTI_WALK_ANY) && !(stack[top].enter <= p->t[lane]));
        index = stack[top].index;
        count = stack[top].count;
    }
}

#define RTI_WIDE(name, constants)                                                                                                 \
    RTI_NOINLINE RTI_TARGET unsigned name(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t index, uint32_t count,    \
                                          uint32_t inst, const rti_job *job)                                                      \
    {                                                                                                                             \
        unsigned found = 0;                                                                                                       \
        for (; live; live &= live - 1) found |= rti_wide_body(accel, p, rti_lowest_bit(live), index, count, inst, constants, job); \
        return found;                                                                                                             \
    }
RTI_WIDE(rti_wide_closest, 0)
RTI_WIDE(rti_wide_any, RTI_WALK_ANY)
#if RTI_SPHERES || RTI_INSTANCES
RTI_WIDE(rti_wide_closest_all, RTI_WALK_ALL)
RTI_WIDE(rti_wide_any_all, RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#if RTI_STATS
RTI_WIDE(rti_wide_closest_count, RTI_WALK_COUNT | RTI_WALK_ALL)
RTI_WIDE(rti_wide_any_count, RTI_WALK_COUNT | RTI_WALK_ALL | RTI_WALK_ANY)
#endif
#undef RTI_WIDE

/* Triangles alone, from the root on. */
RTI_NOINLINE RTI_TARGET unsigned rti_wide_root_closest(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    return rti_wide_closest(accel, p, live, 0, 0, inst, job);
}
RTI_NOINLINE RTI_TARGET unsigned rti_wide_root_any(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    return rti_wide_any(accel, p, live, 0, 0, inst, job);
}

RTI_FN unsigned rti_wide_from(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t index, uint32_t count, uint32_t inst,
                              const rti_job *job)
{
    const bool any = job->query == RT_ANY;
#if RTI_STATS
    if (job->stats)
        return any ? rti_wide_any_count(accel, p, live, index, count, inst, job) : rti_wide_closest_count(accel, p, live, index, count, inst, job);
#endif
#if RTI_SPHERES || RTI_INSTANCES
    if (accel->slots[RTI_SPHERE] || accel->slots[RTI_INSTANCE])
        return any ? rti_wide_any_all(accel, p, live, index, count, inst, job) : rti_wide_closest_all(accel, p, live, index, count, inst, job);
#endif
    return any ? rti_wide_any(accel, p, live, index, count, inst, job) : rti_wide_closest(accel, p, live, index, count, inst, job);
}


/* Packets of RT_BVH_WIDE: the SIMD ray. Its rays go together while more than two of them meet a box, and then on by themselves. What bounds
   them is intervals of origins and inverse directions: between which t rays of the same octant cross a plane is told by the four products of
   their ends. So 8 children, or triangles, are asked at once, and then one child with all rays. Rounding is monotonic, so no box is missed
   that rti_prepare's planes of one ray would meet. */

#define RTI_FEW_LANES 2                     /* so many go on alone */
#define RTI_FEW_NODES 32                    /* of a binary tree that SIMD rays with nothing in common sooner walk than single ones the wide tree */

/* The least and the greatest of rays of one octant, each for the planes that they meet first and last. */
typedef struct { rti_v near_org[3], far_org[3], least[3], most[3], tmin; } rti_interval;

/* Of those lanes, in an order that the octant does not change: org with its pad, and rdir. */
RTI_FN void rti_bound_lanes(const rti_packet *p, unsigned lanes, int k, float org[2], float rdir[2])
{
    const rti_v high = rti_vset(RTI_INFINITY), low = rti_vset(-RTI_INFINITY), pad = rti_vload(p->pad), at = rti_vload(p->org[k]);
    org[0] = rti_vleast(rti_vselect(lanes, rti_vsub(at, pad), high));
    org[1] = rti_vmost(rti_vselect(lanes, rti_vadd(at, pad), low));
    rdir[0] = rti_vleast(rti_vselect(lanes, rti_vload(p->rdir[k]), high));
    rdir[1] = rti_vmost(rti_vselect(lanes, rti_vload(p->rdir[k]), low));
}

RTI_FN rti_interval rti_make_interval(const rti_packet *p, unsigned lanes)
{
    rti_interval r;
    int k;
    r.tmin = rti_vset(rti_vleast(rti_vselect(lanes, rti_vload(p->tmin), rti_vset(RTI_INFINITY))));
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        float org[2], rdir[2];
        rti_bound_lanes(p, lanes, k, org, rdir);
        r.near_org[k] = rti_vset(org[1 - p->side[k]]);
        r.far_org[k] = rti_vset(org[p->side[k]]);
        r.least[k] = rti_vset(rdir[0]);
        r.most[k] = rti_vset(rdir[1]);
    }
    return r;
}

/* Boxes that some ray may meet before t, and where the first enters each; by their planes that are met first and last. */
RTI_FN unsigned rti_cross_interval(const rti_interval *r, const rti_v near_side[3], const rti_v far_side[3], rti_v t, rti_v *enter)
{
    rti_v first[3], last[3];
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const rti_v a = rti_vsub(near_side[k], r->near_org[k]), b = rti_vsub(far_side[k], r->far_org[k]);
        first[k] = rti_vmin(rti_vmul(a, r->least[k]), rti_vmul(a, r->most[k]));
        last[k] = rti_vmax(rti_vmul(b, r->least[k]), rti_vmul(b, r->most[k]));
    }
    *enter = rti_vmax(rti_vmax(first[0], first[1]), rti_vmax(first[2], r->tmin));
    return rti_vle(*enter, rti_vmin(rti_vmin(last[0], last[1]), rti_vmin(last[2], t)));
}

/* The planes of boxes that rays of an octant, side, meet first and last: of children i and on of a node; of one of them, in all lanes; of the
   triangles at and on of an octet. */
RTI_FN void rti_wide_boxes(const rti_wide *node, int i, const int side[3], rti_v near_side[3], rti_v far_side[3])
{
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        near_side[k] = rti_vload(node->bounds[3 * side[k] + k] + i);
        far_side[k] = rti_vload(node->bounds[3 - 3 * side[k] + k] + i);
    }
}

RTI_FN void rti_wide_box(const rti_wide *node, int child, const int side[3], rti_v near_side[3], rti_v far_side[3])
{
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        near_side[k] = rti_vset(node->bounds[3 * side[k] + k][child]);
        far_side[k] = rti_vset(node->bounds[3 - 3 * side[k] + k][child]);
    }
}

RTI_FN void rti_octet_boxes(const rti_octet *octet, uint32_t at, const int side[3], rti_v near_side[3], rti_v far_side[3])
{
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const rti_v a = rti_vload(octet->v[k] + at), b = rti_vload(octet->v[3 + k] + at), c = rti_vload(octet->v[6 + k] + at);
        const rti_v low = rti_vmin(rti_vmin(a, b), c), high = rti_vmax(rti_vmax(a, b), c);
        near_side[k] = side[k] ? high : low;
        far_side[k] = side[k] ? low : high;
    }
}

/* Lanes that meet a box: rti_hit_box. */
RTI_FN unsigned rti_meet_lanes(const rti_packet *p, const rti_v near_side[3], const rti_v far_side[3])
{
    rti_v first[3], last[3];
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const rti_v rdir = rti_vload(p->rdir[k]);
        first[k] = rti_vplane(near_side[k], rti_vload(p->plane[p->side[k]][k]), rdir);
        last[k] = rti_vplane(far_side[k], rti_vload(p->plane[1 - p->side[k]][k]), rdir);
    }
    return rti_vle(rti_vmax(rti_vmax(first[0], first[1]), rti_vmax(first[2], rti_vload(p->tmin))),
                   rti_vmin(rti_vmin(last[0], last[1]), rti_vmin(last[2], rti_vload(p->t))));
}

/* The triangles of an octet whose boxes some ray may meet, one after the other. */
RTI_FN unsigned rti_sheaf_octet(rti_packet *p, const rti_interval *r, rti_v t, unsigned live, const rti_octet *octet, uint32_t count, uint32_t inst,
                                const int flags, const rti_job *job)
{
    unsigned found = 0;
    uint32_t at;
    (void)job;
    for (at = 0; at < RTI_CHILDREN && at < count && live; at += RTI_WIDTH) {
        rti_v near_side[3], far_side[3], enter;
        unsigned kept;
        int kz;
        rti_octet_boxes(octet, at, p->side, near_side, far_side);
        kept = rti_cross_interval(r, near_side, far_side, t, &enter);
        if (at + RTI_WIDTH > count) kept &= (1u << (count - at)) - 1;
        RTI_TALLY(job->stats, RTI_COUNTS(job) ? RTI_WALK_COUNT : 0, prims, rti_bit_count(kept) * rti_bit_count(live));
        for (kz = kept ? p->first_axis : 3; kz <= p->last_axis; kz++) {
            unsigned lanes = live & p->axis[kz], todo = kept;
            rti_shear shear;
            if (!lanes) continue;
            shear = rti_make_shear(p, kz);
            for (; todo && lanes; todo &= todo - 1) {
                const uint32_t i = at + (uint32_t)rti_lowest_bit(todo);
                const unsigned hit = rti_hit_triangle(p, &shear, lanes, octet->v[0] + i, RTI_CHILDREN, octet->prim[i], inst, flags);
                found |= hit;
                if (flags & RTI_WALK_ANY) lanes &= ~hit;
            }
        }
        if (flags & RTI_WALK_ANY) live &= ~found;
    }
    return found;
}

/* From a node on; r bounds at least the live lanes. */
RTI_FN unsigned rti_sheaf_body(const rt_accel *accel, rti_packet *p, unsigned live, const rti_interval *r, uint32_t index, uint32_t inst,
                               const bool any, const rti_job *job)
{
    struct { const rti_wide *node; float enter; int child; unsigned lanes; } stack[RTI_WIDE_STACK];
    const int flags = any ? RTI_WALK_ANY : 0, counts = RTI_COUNTS(job) ? RTI_WALK_COUNT : 0;
    float farthest = rti_vmost(rti_vselect(live, rti_vload(p->t), rti_vset(-RTI_INFINITY)));
    unsigned found = 0, lanes = live;
    int top = 0;
    (void)counts;
    for (;;) {
        const rti_wide *node = accel->wides + index;
        float enter[RTI_CHILDREN];
        rti_v near_side[3], far_side[3], first;
        unsigned hit = 0;
        const int base = top;
        int i;
        for (i = 0; i < RTI_CHILDREN; i += RTI_WIDTH) {
            rti_wide_boxes(node, i, p->side, near_side, far_side);
            hit |= rti_cross_interval(r, near_side, far_side, rti_vset(farthest), &first) << i;
            rti_vstore(enter + i, first);
        }
        RTI_TALLY(job->stats, counts, steps, 1);
        RTI_TALLY(job->stats, counts, nodes, rti_bit_count(lanes));
        RTI_TALLY(job->stats, counts, active, rti_bit_count(lanes));
        RTI_TALLY(job->stats, counts, frusta, RTI_CHILDREN);
        RTI_TALLY(job->stats, counts, culled, RTI_CHILDREN - rti_bit_count(hit));
        RTI_TALLY(job->stats, counts, pushes, rti_bit_count(hit));
        for (; hit; hit &= hit - 1) {
            const int next = rti_lowest_bit(hit);
            int at = top++;
            for (; !any && at > base && stack[at - 1].enter < enter[next]; at--) stack[at] = stack[at - 1];
            stack[at].node = node;
            stack[at].enter = enter[next];
            stack[at].child = next;
            stack[at].lanes = lanes;
        }
        for (;;) {
            uint32_t count, n;
            if (!top) return found;
            top--;
            if (!(stack[top].enter <= farthest)) continue;
            lanes = stack[top].lanes & live;
            node = stack[top].node;
            i = stack[top].child;
            rti_wide_box(node, i, p->side, near_side, far_side);
            RTI_TALLY(job->stats, counts, boxes, rti_bit_count(lanes));
            lanes &= rti_meet_lanes(p, near_side, far_side);
            if (!lanes) continue;
            index = node->index[i];
            count = node->count[i];
            n = count & RTI_COUNT_MASK;
            if (rti_bit_count(lanes) <= RTI_FEW_LANES) hit = rti_wide_from(accel, p, lanes, index, count, inst, job);
            else if (!count) break;
            else {
                RTI_TALLY(job->stats, counts, steps, 1);
                RTI_TALLY(job->stats, counts, leaves, rti_bit_count(lanes));
                RTI_TALLY(job->stats, counts, active, rti_bit_count(lanes));
                if (count >> RTI_KIND_SHIFT == RTI_TRIANGLE) {
                    rti_octet gathered;
                    const rti_octet *octet = &gathered;
                    if (accel->octets) octet = accel->octets + index;
                    else rti_gather_octet(accel, index, n, &gathered);
                    hit = rti_sheaf_octet(p, r, rti_vset(farthest), lanes, octet, n, inst, flags, job);
                } else {
                    RTI_TALLY(job->stats, counts, prims, n * (uint32_t)rti_bit_count(lanes));
                    hit = 0;
#if RTI_SPHERES
                    if (count >> RTI_KIND_SHIFT == RTI_SPHERE) hit = rti_hit_spheres(accel, p, lanes, NULL, index, n, inst, flags);
#endif
#if RTI_INSTANCES
                    if (count >> RTI_KIND_SHIFT == RTI_INSTANCE) hit = rti_hit_instances(accel, p, lanes, NULL, index, n, inst, job);
#endif
                }
            }
            if (!hit) continue;
            found |= hit;
            if (any && !(live &= ~hit)) return found;
            farthest = rti_vmost(rti_vselect(live, rti_vload(p->t), rti_vset(-RTI_INFINITY)));
        }
    }
}

RTI_NOINLINE RTI_TARGET unsigned rti_sheaf_closest(const rt_accel *accel, rti_packet *p, unsigned live, const rti_interval *r, uint32_t index,
                                                   uint32_t inst, const rti_job *job)
{
    return rti_sheaf_body(accel, p, live, r, index, inst, false, job);
}

RTI_NOINLINE RTI_TARGET unsigned rti_sheaf_any(const rt_accel *accel, rti_packet *p, unsigned live, const rti_interval *r, uint32_t index,
                                               uint32_t inst, const rti_job *job)
{
    return rti_sheaf_body(accel, p, live, r, index, inst, true, job);
}

RTI_NOINLINE RTI_TARGET unsigned rti_walk_wide(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    if (job->side > 1 && p->uniform && rti_bit_count(live) > RTI_FEW_LANES) {
        const rti_interval r = rti_make_interval(p, live);
        return job->query == RT_ANY ? rti_sheaf_any(accel, p, live, &r, 0, inst, job) : rti_sheaf_closest(accel, p, live, &r, 0, inst, job);
    }
    return rti_wide_from(accel, p, live, 0, 0, inst, job);
}

#endif /* RTI_WIDTH > 1 && RTI_BVH */

/* ---- >>walk --------------------------------------------------------------------------------------------------------- */

/* Bodies that leave out what an accel does not have, or a job does not ask for; chosen once a batch. */

RTI_NOINLINE RTI_TARGET unsigned rti_walk_nothing(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    (void)accel, (void)p, (void)live, (void)inst, (void)job;
    return 0;
}

RTI_FN rti_walker rti_tree_walker(const rt_accel *accel, const rti_job *job)
{
    const bool any = job->query == RT_ANY;
    (void)any;
    if (!accel->node_count) return rti_walk_nothing;
#if RTI_KDTREE
    if (accel->structure == RT_KDTREE) return rti_kd_walker(accel, job);
#endif
#if RTI_THREADED
    if (accel->structure == RT_THREADED) return rti_thread_walker(accel, job);
#endif
#if RTI_BVH
#if RTI_WIDTH > 1
    if (accel->wides && (!accel->nodes || (job->wide && (job->side == 1 || accel->node_count > RTI_FEW_NODES)))) {
        if (job->side > 1 || accel->slots[RTI_SPHERE] || accel->slots[RTI_INSTANCE] || job->stats) return rti_walk_wide;
        return any ? rti_wide_root_any : rti_wide_root_closest;
    }
#endif
#if RTI_STATS
    if (job->stats) return any ? rti_walk_any_count : rti_walk_closest_count;
#endif
#if RTI_SPHERES || RTI_INSTANCES
    if (accel->slots[RTI_SPHERE] || accel->slots[RTI_INSTANCE]) return any ? rti_walk_any_all : rti_walk_closest_all;
#endif
    return any ? rti_walk_any : rti_walk_closest;
#else
    return rti_walk_nothing;
#endif
}

#if RTI_PLANES
/* First: what is behind them need not be looked at. */
RTI_NOINLINE RTI_TARGET unsigned rti_walk_planes(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    const unsigned found = rti_hit_planes(accel, p, live, inst, job), left = job->query == RT_ANY ? live & ~found : live;
    return found | (left ? rti_tree_walker(accel, job)(accel, p, left, inst, job) : 0);
}
#endif

RTI_FN rti_walker rti_walker_of(const rt_accel *accel, const rti_job *job)
{
#if RTI_PLANES
    if (RTI_UNLIKELY(accel->plane_count)) return rti_walk_planes;
#endif
    return rti_tree_walker(accel, job);
}

/* For rt_accel.single_walks. */
RTI_NOINLINE RTI_TARGET rti_any_walker rti_single_walk(const rt_accel *accel, const rti_job *job) { return (rti_any_walker)rti_walker_of(accel, job); }

RTI_NOINLINE RTI_TARGET unsigned rti_walk(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    return live ? rti_walker_of(accel, job)(accel, p, live, inst, job) : 0;
}

/* ---- >>large -------------------------------------------------------------------------------------------------------- */

#if RTI_WIDTH > 1 && RTI_BVH

/* [Overbeck] 3 and 4: up to RT_MAX_PACKET x RT_MAX_PACKET rays go down the tree together, the SIMD ray (an rti_packet) being the smallest of
   them. Lanes without a legal ray, and those that need no more hits, have an empty interval: tmin infinite, t below it. Every test fails
   for them by itself, so no masks are kept. */

#define RTI_SIMD_RAYS (RT_MAX_PACKET * RT_MAX_PACKET / RTI_WIDTH)   /* of the largest packet */
#define RTI_NESTED (256 / RTI_WIDTH)        /* SIMD rays that go through an instance together */

typedef struct {
    rti_packet *rays;                       /* SIMD rays */
    int count, open;                        /* open: those that still need hits */
    bool shared;                            /* all rays start at one point, and rti_prepare_shared has prepared them */
    bool apex;                              /* all rays pass one point at t = apex_t, 0 or 1 */
    float apex_t;
    bool uniform;                           /* all dirs have the same signs */
    int near_plane[3], far_plane[3];        /* uniform: which of a box's bounds are met first, and which last */
    float pad, near_org[3], far_org[3];     /* of all rays; what is subtracted from those planes: the apex, if any, and the pad */
    float way[3];                           /* the sum of all dirs */
    rti_frustum frustum;
    float outside[RTI_WIDTH], slopes[RTI_WIDTH], rslopes[RTI_WIDTH], beyond[RTI_WIDTH];     /* of it: four lanes, twice with 8 */
    rt_cull cull;                           /* RT_CULL_NONE where there is no frustum */
    unsigned char order[RTI_SIMD_RAYS];     /* SIMD rays: the living first (Partition), or scratch */
} rti_large;

/* The box test of a node: what is alike for all rays, its planes moved out by the pad of the packet and, where there is an apex, as seen
   from it. (Two more roundings than rti_prepare thinks of, of bounds and of the difference, are in that pad.) */
typedef struct { const float *bounds; rti_v near_plane[3], far_plane[3]; } rti_door;

RTI_FN rti_door rti_make_door(const rti_large *g, const float *bounds)
{
    rti_door door;
    int k;
    door.bounds = bounds;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        door.near_plane[k] = rti_vset(bounds[g->near_plane[k]] - g->near_org[k]);
        door.far_plane[k] = rti_vset(bounds[g->far_plane[k]] - g->far_org[k]);
    }
    return door;
}

/* Lanes of a SIMD ray that meet the box. */
RTI_FN unsigned rti_pass(const rti_large *g, const rti_door *door, const rti_packet *p)
{
    rti_v tmin = rti_vload(p->tmin), t = rti_vload(p->t), a[3], b[3];
    int k;
    if (g->apex) {
        tmin = rti_vsub(tmin, rti_vset(g->apex_t));
        t = rti_vsub(t, rti_vset(g->apex_t));
    }
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        const rti_v rdir = rti_vload(p->rdir[k]);
        if (g->apex) {
            a[k] = rti_vmul(door->near_plane[k], rdir);
            b[k] = rti_vmul(door->far_plane[k], rdir);
        } else {
            const rti_v org = rti_vload(p->plane[0][k]);
            a[k] = rti_vplane(door->near_plane[k], org, rdir);
            b[k] = rti_vplane(door->far_plane[k], org, rdir);
        }
    }
    if (!g->uniform) {
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const rti_v enter = rti_vmin(a[k], b[k]);
            b[k] = rti_vmax(a[k], b[k]);
            a[k] = enter;
        }
    }
    return rti_vle(rti_vmax(rti_vmax(a[0], a[1]), rti_vmax(a[2], tmin)), rti_vmin(rti_vmin(b[0], b[1]), rti_vmin(b[2], t)));
}

/* Smallest and largest lane. */
RTI_FN void rti_lane_range(rti_v a, rti_v b, float *low, float *high)
{
    *low = rti_vleast(a);
    *high = rti_vmost(b);
}

/* Lane by lane over all rays: least and greatest of three numbers. */
typedef struct { rti_v low[3], high[3]; } rti_range;

RTI_FN rti_range rti_no_range(void)
{
    rti_range r;
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        r.low[k] = rti_vset(RTI_INFINITY);
        r.high[k] = rti_vset(-RTI_INFINITY);
    }
    return r;
}

RTI_FN void rti_range_add(rti_range *r, int k, rti_v x)
{
    r->low[k] = rti_vmin(x, r->low[k]);
    r->high[k] = rti_vmax(x, r->high[k]);
}

/* Slopes u / k and v / k of all rays, kept in them; their bounds. Answers the least |dir| along k; not above 0: some ray does not follow it that
   way. */
RTI_FN float rti_survey_slopes(const rti_large *g, rti_frustum *f)
{
    rti_range range = rti_no_range();
    rti_v shortest = rti_vset(RTI_INFINITY);
    float least, most;
    int i, a;
    for (i = 0; i < g->count; i++) {
        rti_packet *p = &g->rays[i];
        const rti_v rdir = rti_vload(p->rdir[f->k]);
        shortest = rti_vmin(rti_vmul(rti_vload(p->dir[f->k]), rti_vset(f->sign)), shortest);
        RTI_UNROLL
        for (a = 0; a < 2; a++) {
            const rti_v slope = rti_vmul(rti_vload(p->dir[a ? f->v : f->u]), rdir);
            rti_vstore(p->slope[a], slope);
            rti_range_add(&range, a, slope);
        }
    }
    for (a = 0; a < 2; a++) rti_lane_range(range.low[a], range.high[a], &f->low[a], &f->high[a]);
    rti_lane_range(shortest, shortest, &least, &most);
    return least;
}

/* Where all rays cross the planes at s = 0 and at s = length: [Overbeck] 4.3. */
RTI_FN void rti_bound_general(const rti_large *g, rti_frustum *f)
{
    const rti_v start = rti_vset(f->start), length = rti_vset(f->length * f->sign);
    rti_range range[2];                     /* near and far */
    int i, a, end;
    range[0] = range[1] = rti_no_range();
    for (i = 0; i < g->count; i++) {
        const rti_packet *p = &g->rays[i];
        const rti_v back = rti_vsub(start, rti_vload(p->org[f->k]));
        RTI_UNROLL
        for (a = 0; a < 2; a++) {
            const rti_v slope = rti_vload(p->slope[a]), x = rti_vadd(rti_vload(p->org[a ? f->v : f->u]), rti_vmul(slope, back));
            rti_range_add(&range[0], a, x);
            rti_range_add(&range[1], a, rti_vadd(x, rti_vmul(slope, length)));
        }
    }
    for (a = 0; a < 2; a++) {
        float low[2], high[2];
        for (end = 0; end < 2; end++) rti_lane_range(range[end].low[a], range[end].high[a], &low[end], &high[end]);
        rti_set_sides(f, a, low[0], high[0], low[1], high[1]);
    }
}

/* All rays, legal and from one origin, prepared at once: what rti_prepare works out from the origin, the pad too, is the same for all, and
   no planes are kept. False: they are not so. */
RTI_FN bool rti_prepare_shared(const rt_accel *accel, rti_large *g)
{
    const float org[3] = { g->rays[0].org[0][0], g->rays[0].org[1][0], g->rays[0].org[2][0] };
    rti_v reach, far_org, longest = rti_vset(0), shortest = rti_vset(RTI_INFINITY), most, pad;
    float far_out = 0, coordinate = 0, least, largest;
    int i, k;
    for (i = 0; i < g->count; i++) {
        const rti_packet *p = &g->rays[i];
        unsigned same = rti_vlt(rti_vload(p->tmin), rti_vload(p->t));
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const rti_v x = rti_vload(p->org[k]), at = rti_vset(org[k]);
            same &= rti_vle(x, at) & rti_vle(at, x);
        }
        if (same != RTI_ALL_LANES) return false;
    }
    for (k = 0; k < 3; k++) {
        far_out = rti_maxf(far_out, rti_maxf(fabsf(accel->lower[k] - org[k]), fabsf(accel->upper[k] - org[k])));
        coordinate = rti_maxf(coordinate, fabsf(org[k]));
    }
    if (!(coordinate <= RT_MAX_COORDINATE)) return false;
    reach = rti_vset(far_out);
    far_org = rti_vset(coordinate);
    for (i = 0; i < g->count; i++) {
        rti_packet *p = &g->rays[i];
        const rti_v dir[3] = { rti_vload(p->dir[0]), rti_vload(p->dir[1]), rti_vload(p->dir[2]) };
        rti_v bound;
        unsigned legal = rti_orient(p, dir, RTI_ALL_LANES, &most);
        RTI_UNROLL
        for (k = 0; k < 3; k++) legal &= rti_vle(rti_vabs(dir[k]), rti_vset(RT_MAX_DIRECTION));   /* each: most may overlook what is no number */
        if (legal != RTI_ALL_LANES) return false;
        longest = rti_vmax(most, longest);
        shortest = rti_vmin(most, shortest);
        bound = rti_least(reach, far_org, most);
        p->uniform = true;
        RTI_UNROLL
        for (k = 0; k < 3; k++) (void)rti_invert_dir(p, k, dir[k], bound, RTI_ALL_LANES);
    }
    rti_lane_range(shortest, longest, &least, &largest);
    shortest = rti_vset(least);             /* of which the clamp is greatest */
    pad = rti_pad(accel, reach, far_org, rti_vdiv(rti_least(reach, far_org, shortest), shortest), rti_vset(largest));
    rti_lane_range(pad, pad, &least, &g->pad);
    return true;
}

/* What is alike for all rays of a prepared packet, and the frustum that bounds them, if they can be. */
RTI_NOINLINE RTI_TARGET void rti_make_frustum(const rt_accel *accel, rti_large *g, rt_cull cull)
{
    rti_frustum *f = &g->frustum;
    rti_bundle bundle;
    rti_range orgs = rti_no_range(), ends = rti_no_range();
    rti_v sum[3], pads = rti_vset(0), first = rti_vset(RTI_INFINITY), last = rti_vset(-RTI_INFINITY);
    float lanes[RTI_WIDTH], unused;
    bool aimed;
    int i, k;
    sum[0] = sum[1] = sum[2] = rti_vset(0);
    bundle.sides[0] = bundle.sides[1] = bundle.sides[2] = 0;
    for (i = 0; i < g->count; i++) {
        const rti_packet *p = &g->rays[i];
        first = rti_vmin(rti_vload(p->tmin), first);
        last = rti_vmax(rti_vload(p->t), last);
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const rti_v dir = rti_vload(p->dir[k]);
            const unsigned negative = rti_vnegative(dir);
            sum[k] = rti_vadd(sum[k], dir);
            bundle.sides[k] |= (unsigned)(negative != RTI_ALL_LANES) | (unsigned)(negative != 0) << 1;
        }
        if (g->shared) continue;
        pads = rti_vmax(rti_vload(p->pad), pads);
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const rti_v org = rti_vload(p->org[k]);
            rti_range_add(&orgs, k, org);
            rti_range_add(&ends, k, rti_vadd(org, rti_vload(p->dir[k])));
        }
    }
    rti_lane_range(first, last, &bundle.tmin, &bundle.tmax);
    if (!g->shared) rti_lane_range(pads, pads, &unused, &g->pad);
    bundle.pad = g->pad;
    g->uniform = true;
    for (k = 0; k < 3; k++) {
        bundle.org_low[k] = bundle.org_high[k] = g->rays[0].org[k][0];
        bundle.end_low[k] = bundle.end_high[k] = 0;
        if (!g->shared) {
            rti_lane_range(orgs.low[k], orgs.high[k], &bundle.org_low[k], &bundle.org_high[k]);
            rti_lane_range(ends.low[k], ends.high[k], &bundle.end_low[k], &bundle.end_high[k]);
        }
        rti_vstore(lanes, sum[k]);
        g->way[k] = 0;
        for (i = 0; i < RTI_WIDTH; i++) g->way[k] += lanes[i];
        bundle.way[k] = g->way[k];
        if (bundle.sides[k] == 3) g->uniform = false;
    }
    aimed = rti_aim_frustum(accel, &bundle, f);
    g->apex = f->sway >= 0;
    g->apex_t = f->to_point ? 1 : 0;
    for (k = 0; k < 3; k++) {
        const bool down = (bundle.sides[k] & 2) != 0;
        const float at = g->apex ? f->apex[k] : 0;
        g->near_plane[k] = k + (down ? 3 : 0);
        g->far_plane[k] = k + (down ? 0 : 3);
        g->near_org[k] = down ? at - f->pad : at + f->pad;
        g->far_org[k] = down ? at + f->pad : at - f->pad;
    }

    g->cull = RT_CULL_NONE;
    if (!aimed || !rti_span_frustum(accel, &bundle, f, rti_survey_slopes(g, f))) {
        f->sway = -1;
        return;
    }
    if (f->sway < 0) rti_bound_general(g, f);
    rti_close_frustum(f);
    for (i = 0; i < RTI_WIDTH; i++) {
        g->outside[i] = f->outside[i % 4];
        g->slopes[i] = f->slope[i % 4];
        g->rslopes[i] = f->rslope[i % 4];
        g->beyond[i] = f->beyond[i % 4];
    }
    g->cull = cull;
}

/* No ray of g meets the box: by one of the side planes, or, with corner rays, because it lies beside two of them: no s is left at which it
   is within all four bounds. [Overbeck] asks that all four corner rays are separated by the same slab, which also throws out a box between
   rays that pass it on either side. */
RTI_FN bool rti_cull_box(const rti_large *g, const float *bounds)
{
    const rti_frustum *f = &g->frustum;
    const float at = f->sign * f->start, lo = f->sign * bounds[f->near_k] - at - f->pad, hi = f->sign * bounds[f->far_k] - at + f->pad;
    const float from = lo > 0 ? lo : 0, to = hi < f->length ? hi : f->length;
    const rti_v most = rti_vquad(bounds[3 + f->u], -bounds[f->u], bounds[3 + f->v], -bounds[f->v]);
    const rti_v room = rti_vsub(most, rti_vload(g->outside)), slope = rti_vload(g->slopes);
    if (from > to) return true;
    if (g->cull & RT_CULL_PLANES && rti_vlt(room, rti_vmin(rti_vmul(slope, rti_vset(from)), rti_vmul(slope, rti_vset(to))))) return true;
    if (g->cull & RT_CULL_CORNERS) {        /* a plane leaves the box at s or enters it there: min and max over lanes, by pairs */
        const rti_v s = rti_vmul(room, rti_vload(g->rslopes));
        const rti_v last = rti_vmin(rti_vmax(s, rti_vload(g->beyond)), rti_vset(to));
        const rti_v first = rti_vmax(rti_vmin(s, rti_vload(g->beyond)), rti_vset(from));
        return rti_vapart(last, first);
    }
    return false;
}

/* Triangles of a leaf, RTI_WIDTH at a time. */
typedef struct {
    const float *corners[RTI_WIDTH];
    uint32_t prim[RTI_WIDTH];
    float gathered[RTI_WIDTH][9];
    float corner[9][RTI_WIDTH];             /* the vertices again, side by side */
    float edge[3][3][RTI_WIDTH];            /* of each edge: what its function is made of, see rti_edges */
    float doubt[RTI_WIDTH];                 /* what those may be wrong by */
} rti_facets;

/* The rays pass through the apex, so each edge's function is linear in a ray's slopes: (a x b)[k] + slope_u (a x b)[u] + slope_v (a x b)[v],
   with a and b its ends as seen from the apex. It is the function of rti_hit_triangle but for a factor which all three share, and rounding:
   that moves vertices by 8 e r, r being the farthest coordinate from the apex, and products of two by 64 e r^2; 64 more are added, and
   sway, which with rays that end at the apex knows how far away they begin. Where two functions have other signs by more than that
   doubt, the triangle is missed.
   Answers the triangles that some ray may hit, by the corner rays ([Overbeck] 4): those whose edges have all of them on the same side. */
RTI_FN unsigned rti_edges(const rti_large *g, rti_facets *t)
{
    const rti_frustum *f = &g->frustum;
    const float steep = 1 + 2 * f->steep;
    const int axis[3] = { f->k, f->u, f->v };
    rti_v p[3][3], reach = rti_vset(0), least[4], most[4], doubt;
    unsigned below = 0, above = 0;
    int i, k;
    RTI_UNROLL
    for (i = 0; i < 3; i++) {
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            p[i][k] = rti_vsub(rti_vload(t->corner[3 * i + axis[k]]), rti_vset(f->apex[axis[k]]));
            reach = rti_vmax(rti_vabs(p[i][k]), reach);
        }
    }
    doubt = rti_vmul(rti_vadd(rti_vmul(reach, rti_vset(7.6e-6f)), rti_vset(8 * f->sway)), rti_vmul(reach, rti_vset(steep)));
    doubt = rti_vadd(doubt, rti_vset(1e-34f));
    least[3] = most[3] = rti_vset(0);
    RTI_UNROLL
    for (i = 0; i < 3; i++) {
        const rti_v *a = p[(i + 2) % 3], *b = p[(i + 1) % 3];
        rti_v value[3], lo, hi;
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            value[k] = rti_vsub(rti_vmul(a[y], b[z]), rti_vmul(a[z], b[y]));
            rti_vstore(t->edge[i][k], value[k]);
        }
        least[i] = most[i] = value[0];
        RTI_UNROLL
        for (k = 0; k < 2; k++) {
            lo = rti_vmul(value[k + 1], rti_vset(f->low[k]));
            hi = rti_vmul(value[k + 1], rti_vset(f->high[k]));
            least[i] = rti_vadd(least[i], rti_vmin(lo, hi));
            most[i] = rti_vadd(most[i], rti_vmax(lo, hi));
        }
        below |= rti_vlt(rti_vadd(most[i], doubt), rti_vset(0));
        above |= rti_vlt(doubt, least[i]);
        least[3] = rti_vadd(least[3], least[i]);
        most[3] = rti_vadd(most[3], most[i]);
    }
    rti_vstore(t->doubt, doubt);
    doubt = rti_vmul(doubt, rti_vset(4));   /* of the sum: where it is positive for all rays, so is some edge of each */
    if (!(g->cull & RT_CULL_CORNERS)) return RTI_ALL_LANES;
    return ~((below & (above | rti_vlt(doubt, least[3]))) | (above & rti_vlt(rti_vadd(most[3], doubt), rti_vset(0)))) & RTI_ALL_LANES;
}

/* Triangles that do not lie beyond one of the side planes. */
RTI_FN unsigned rti_between_planes(const rti_large *g, const rti_facets *t)
{
    const rti_frustum *f = &g->frustum;
    rti_v s[3], x[3];
    unsigned kept;
    int i, k;
    RTI_UNROLL
    for (i = 0; i < 3; i++) s[i] = rti_vmul(rti_vsub(rti_vload(t->corner[3 * i + f->k]), rti_vset(f->start)), rti_vset(f->sign));
    kept = rti_vle(rti_vmin(rti_vmin(s[0], s[1]), s[2]), rti_vset(f->length + f->pad)) &
           rti_vle(rti_vset(-f->pad), rti_vmax(rti_vmax(s[0], s[1]), s[2]));
    for (k = 0; k < 4; k++) {
        const rti_v slope = rti_vset(f->slope[k]), least = rti_vset(f->bound[k] - f->pad);
        RTI_UNROLL
        for (i = 0; i < 3; i++) {
            x[i] = rti_vload(t->corner[3 * i + (k < 2 ? f->u : f->v)]);
            x[i] = rti_vsub(k & 1 ? rti_vsub(rti_vset(0), x[i]) : x[i], rti_vmul(slope, s[i]));
        }
        kept &= rti_vle(least, rti_vmax(rti_vmax(x[0], x[1]), x[2]));
    }
    return kept;
}

/* The exact test: the triangles of kept, on those lanes of a SIMD ray that may hit them. */
RTI_FN unsigned rti_hit_facets(rti_packet *p, unsigned lanes, const rti_facets *t, unsigned kept, uint32_t inst, const int flags)
{
    unsigned found = 0;
    int kz;
    for (kz = p->first_axis; kz <= p->last_axis; kz++) {
        unsigned live = lanes & p->axis[kz], left = kept;
        rti_shear shear;
        if (!live) continue;
        shear = rti_make_shear(p, kz);
        for (; left && live; left &= left - 1) {
            const int i = rti_lowest_bit(left);
            const unsigned hit = rti_hit_triangle(p, &shear, live, t->corners[i], 1, t->prim[i], inst, flags);
            if (flags & RTI_WALK_ANY) live &= ~hit;
            found |= hit;
        }
    }
    return found;
}

#define RTI_FACETS(name, flags)                                                                                                     \
    RTI_NOINLINE RTI_TARGET unsigned name(rti_packet *p, unsigned lanes, const rti_facets *t, unsigned kept, uint32_t inst)         \
    {                                                                                                                               \
        return rti_hit_facets(p, lanes, t, kept, inst, flags);                                                                      \
    }
RTI_FACETS(rti_facets_closest, 0)
RTI_FACETS(rti_facets_any, RTI_WALK_ANY)
RTI_FACETS(rti_facets_closest_likely, RTI_WALK_LIKELY)
RTI_FACETS(rti_facets_any_likely, RTI_WALK_ANY | RTI_WALK_LIKELY)
#undef RTI_FACETS

/* Notes what lanes of a SIMD ray have hit; with RT_ANY they are done. */
RTI_FN void rti_note(rti_large *g, rti_packet *p, unsigned hit, bool any)
{
    p->found |= hit;
    if (!any || !hit) return;
    rti_vstore(p->t, rti_vselect(hit, rti_vset(-RTI_INFINITY), rti_vload(p->t)));
    p->live &= ~hit;
    if (!p->live) g->open--;
}

RTI_FN uint32_t rti_count_rays(const rti_large *g, const unsigned char *list, int length)
{
    uint32_t n = 0;
    int i;
    for (i = 0; i < length; i++) n += (uint32_t)rti_bit_count(g->rays[list[i]].live);
    return n;
}

/* The triangles first, first + 1, ... of a leaf against the SIMD rays of list: culled by the frustum, then, where there is an apex, by edges
   that cost six products a SIMD ray, and only then tested. */
RTI_NOINLINE RTI_TARGET void rti_large_triangles(const rt_accel *accel, rti_large *g, uint32_t first, uint32_t count,
                                                 const unsigned char *list, int length, uint32_t inst, const rti_job *job, int depth)
{
    const bool any = job->query == RT_ANY;
    rti_facets t;
    uint32_t at;
    int i, k;
    (void)depth;
    for (at = first; at < first + count; at += RTI_WIDTH) {
        const unsigned n = first + count - at < RTI_WIDTH ? first + count - at : RTI_WIDTH;
        unsigned kept = RTI_ALL_LANES >> (RTI_WIDTH - n), j;
        for (j = 0; j < n; j++) {
            t.corners[j] = rti_corners(accel, at + j, t.gathered[j], &t.prim[j]);
            for (k = 0; k < 9; k++) t.corner[k][j] = t.corners[j][k];
        }
        for (; j < RTI_WIDTH; j++)
            for (k = 0; k < 9; k++) t.corner[k][j] = t.corner[k][0];
        if (g->frustum.sway >= 0) kept &= rti_edges(g, &t);
        if (g->cull & RT_CULL_PLANES) kept &= rti_between_planes(g, &t);
#if RTI_STATS
        if (job->stats) {
            const uint64_t tests = (uint64_t)rti_bit_count(kept) * rti_count_rays(g, list, length);
            job->stats->prims += tests;
            job->stats->prims_at[depth] += tests;
            if (g->cull) {
                job->stats->frusta += n;
                job->stats->culled += n - (unsigned)rti_bit_count(kept);
            }
        }
#endif
        if (g->frustum.sway < 0) {
            for (i = 0; i < length && kept; i++) {
                rti_packet *p = &g->rays[list[i]];
                if (p->live) rti_note(g, p, (any ? rti_facets_any : rti_facets_closest)(p, p->live, &t, kept, inst), any);
            }
            continue;
        }
        for (; kept; kept &= kept - 1) {
            const int lane = rti_lowest_bit(kept);
            const rti_v uk = rti_vset(t.edge[0][0][lane]), uu = rti_vset(t.edge[0][1][lane]), uv = rti_vset(t.edge[0][2][lane]);
            const rti_v vk = rti_vset(t.edge[1][0][lane]), vu = rti_vset(t.edge[1][1][lane]), vv = rti_vset(t.edge[1][2][lane]);
            const rti_v wk = rti_vset(t.edge[2][0][lane]), wu = rti_vset(t.edge[2][1][lane]), wv = rti_vset(t.edge[2][2][lane]);
            const rti_v above = rti_vset(t.doubt[lane]), below = rti_vset(-t.doubt[lane]);
            for (i = 0; i < length; i++) {
                rti_packet *p = &g->rays[list[i]];
                const rti_v su = rti_vload(p->slope[0]), sv = rti_vload(p->slope[1]);
                const rti_v u = rti_vfma(su, uu, rti_vfma(sv, uv, uk));
                const rti_v v = rti_vfma(su, vu, rti_vfma(sv, vv, vk));
                const rti_v w = rti_vfma(su, wu, rti_vfma(sv, wv, wk));
                const unsigned missed = rti_vlt(rti_vmin(rti_vmin(u, v), w), below) & rti_vlt(above, rti_vmax(rti_vmax(u, v), w));
                const unsigned lanes = p->live & ~missed;
                if (!lanes) continue;
                rti_note(g, p, (any ? rti_facets_any_likely : rti_facets_closest_likely)(p, lanes, &t, 1u << lane, inst), any);
            }
        }
    }
}

#if RTI_INSTANCES
static RTI_TARGET void rti_large_walk(const rt_accel *accel, rti_large *g, uint32_t inst, const rti_job *job);

/* The SIMD rays of list, where they meet the box of a leaf of instances, its door, which may be NULL, go on in object space as a large packet of
   their own: at most RTI_NESTED at once, so that nesting takes little stack. Through a k-d tree they go one by one. */
RTI_NOINLINE RTI_TARGET void rti_large_instances(const rt_accel *accel, rti_large *g, const rti_door *door, uint32_t first, uint32_t count,
                                                 const unsigned char *list, int length, uint32_t inst, const rti_job *job)
{
    const bool any = job->query == RT_ANY;
    rti_packet packets[RTI_NESTED];
    unsigned char from[RTI_NESTED];
    rti_large inner;
    uint32_t slot;
    int i, j;
    inner.rays = packets;
    inner.shared = false;
    for (slot = first; slot < first + count; slot++) {
        const rti_instance *in = &accel->instances[slot];
        const uint32_t base = inst + 1 + in->base;
        for (i = 0; i < length;) {
            for (inner.count = 0; i < length && inner.count < RTI_NESTED; i++) {
                rti_packet *p = &g->rays[list[i]], *q = &packets[inner.count];
                const unsigned lanes = door ? rti_pass(g, door, p) & p->live : p->live;
                q->live = lanes ? rti_enter_instance(in, in->accel, p, lanes, q, in->accel->structure == RT_BVH) : 0;
                q->found = 0;
                if (q->live) from[inner.count++] = list[i];
            }
            if (!inner.count) continue;
            if (in->accel->structure == RT_BVH) rti_large_walk(in->accel, &inner, base, job);
            else
                for (j = 0; j < inner.count; j++) packets[j].found = rti_walk(in->accel, &packets[j], packets[j].live, base, job);
            for (j = 0; j < inner.count; j++) {
                rti_packet *p = &g->rays[from[j]];
                if (!any) rti_leave_instance(p, &packets[j], packets[j].found);
                rti_note(g, p, packets[j].found, any);
            }
        }
    }
}
#endif

#if RTI_SPHERES || RTI_INSTANCES
/* Spheres and instances are dear: each SIMD ray is asked for their leaf's box first. */
RTI_NOINLINE RTI_TARGET void rti_large_others(const rt_accel *accel, rti_large *g, const rti_node *leaf, const unsigned char *list, int length,
                                              uint32_t inst, const rti_job *job, int depth)
{
    const uint32_t first = leaf->index, count = rti_leaf_count(leaf);
    const rti_door door = rti_make_door(g, leaf->bounds);       /* again: the one of a walk stays in registers */
    (void)depth;
#if RTI_STATS
    if (job->stats) {
        const uint64_t tests = (uint64_t)count * rti_count_rays(g, list, length);
        job->stats->prims += tests;
        job->stats->prims_at[depth] += tests;
    }
#endif
#if RTI_SPHERES
    if (rti_leaf_kind(leaf) == RTI_SPHERE) {
        const bool any = job->query == RT_ANY;
        int i;
        for (i = 0; i < length; i++) {
            rti_packet *p = &g->rays[list[i]];
            const unsigned lanes = rti_pass(g, &door, p) & p->live;
            if (lanes) rti_note(g, p, rti_hit_spheres(accel, p, lanes, NULL, first, count, inst, any ? RTI_WALK_ANY : 0), any);
        }
        return;
    }
#endif
#if RTI_INSTANCES
    rti_large_instances(accel, g, &door, first, count, list, length, inst, job);
#endif
}
#endif

/* The primitives of a leaf against the SIMD rays of list. */
RTI_FN void rti_large_leaf(const rt_accel *accel, rti_large *g, const rti_node *leaf, const unsigned char *list, int length, uint32_t inst,
                           const rti_job *job, int depth)
{
#if RTI_SPHERES || RTI_INSTANCES
    if (RTI_UNLIKELY(rti_leaf_kind(leaf) != RTI_TRIANGLE)) {
        rti_large_others(accel, g, leaf, list, length, inst, job, depth);
        return;
    }
#endif
    rti_large_triangles(accel, g, leaf->index, rti_leaf_count(leaf), list, length, inst, job, depth);
}

/* A box test, counted. */
RTI_FN unsigned rti_ask(const rti_large *g, const rti_door *door, int i, const int flags, const rti_job *job, int depth)
{
    (void)depth, (void)job, (void)flags;
    RTI_TALLY(job->stats, flags, boxes, rti_bit_count(g->rays[i].live));
    RTI_TALLY(job->stats, flags, boxes_at[depth], rti_bit_count(g->rays[i].live));
    return rti_pass(g, door, &g->rays[i]);
}

RTI_FN bool rti_beside(const rti_large *g, const rti_door *door, const int flags, const rti_job *job)
{
    bool beside;
    (void)job, (void)flags;
    if (!g->cull) return false;
    beside = rti_cull_box(g, door->bounds);
    RTI_TALLY(job->stats, flags, frusta, 1);
    RTI_TALLY(job->stats, flags, culled, beside);
    return beside;
}

/* [Overbeck] 3.2, getFirstHit: the first SIMD ray from active on that meets the box; count: none does. */
RTI_FN int rti_first_hit(const rti_large *g, const rti_door *door, int active, const int flags, const rti_job *job, int depth)
{
    int i;
    if (rti_ask(g, door, active, flags, job, depth)) return active;
    if (rti_beside(g, door, flags, job)) return g->count;
    for (i = active + 1; i < g->count; i++)
        if (rti_ask(g, door, i, flags, job, depth)) return i;
    return g->count;
}

/* getLastHit: one past the last that does; active does. */
RTI_FN int rti_last_hit(const rti_large *g, const rti_door *door, int active, const int flags, const rti_job *job, int depth)
{
    int i;
    for (i = g->count - 1; i > active; i--)
        if (rti_ask(g, door, i, flags, job, depth)) break;
    return i + 1;
}

/* [Overbeck] 3.3, partRays: of the first active entries of order, those that meet the box come to the front; how many. (The paper's text
   answers size(R) where the frustum misses: none do.) */
RTI_FN int rti_part_rays(rti_large *g, const rti_door *door, int active, const int flags, const rti_job *job, int depth)
{
    int i, alive = 0;
    if (rti_beside(g, door, flags, job)) return 0;
    for (i = 0; i < active; i++) {
        const unsigned char at = g->order[i];
        if (rti_ask(g, door, at, flags, job, depth)) {
            g->order[i] = g->order[alive];
            g->order[alive++] = at;
        }
    }
    return alive;
}

/* [Overbeck] 3.1: does any SIMD ray meet the box? At a leaf: which do, listed in order. */
RTI_FN int rti_mask_rays(rti_large *g, const rti_door *door, bool inner, const int flags, const rti_job *job, int depth)
{
    int i, alive = 0;
    if (rti_beside(g, door, flags, job)) return 0;
    for (i = 0; i < g->count && !(inner && alive); i++)
        if (rti_ask(g, door, i, flags, job, depth)) g->order[alive++] = (unsigned char)i;
    return alive;
}

/* [Overbeck] Figure 2, A.1 and A.2 in one: what differs is which SIMD rays stay active. active is, of Ranged, the first that is; of
   Partition, how many entries of order are. The child whose middle comes first along the rays is near. */
RTI_FN void rti_large_body(const rt_accel *accel, rti_large *g, uint32_t inst, const rt_algorithm kind, const int flags, const rti_job *job)
{
    struct { const rti_node *node; int active, depth; } stack[RTI_MAX_DEPTH];
    const rti_node *node = accel->nodes;
    int top = 0, depth = 0, active = kind == RT_BVH_PARTITION ? g->count : 0;
    for (;;) {
        const rti_door door = rti_make_door(g, node->bounds);
        int alive;
        if (kind == RT_BVH_RANGED) {
            active = rti_first_hit(g, &door, active, flags, job, depth);
            alive = g->count - active;
        } else if (kind == RT_BVH_PARTITION) alive = active = rti_part_rays(g, &door, active, flags, job, depth);
        else alive = rti_mask_rays(g, &door, !node->count, flags, job, depth);
#if RTI_STATS
        if (flags & RTI_WALK_COUNT && alive) {
            const uint64_t rays = rti_count_rays(g, kind == RT_BVH_RANGED ? g->order + active : g->order, alive);
            job->stats->steps++;
            job->stats->active += rays;
            if (node->count) job->stats->leaves += rays;
            else job->stats->nodes += rays;
        }
#endif
        if (alive && !node->count) {
            const rti_node *child = accel->nodes + node->index;
            const float *a = child[0].bounds, *b = child[1].bounds;
            const float ahead = g->way[0] * (b[0] - a[0] + (b[3] - a[3])) + g->way[1] * (b[1] - a[1] + (b[4] - a[4])) +
                                g->way[2] * (b[2] - a[2] + (b[5] - a[5]));
            RT_ASSERT(top < RTI_MAX_DEPTH);
            node = ahead < 0 ? child + 1 : child;
            stack[top].node = ahead < 0 ? child : child + 1;
            stack[top].active = active;
            stack[top++].depth = ++depth;
            RTI_TALLY(job->stats, flags, pushes, 1);
            continue;
        }
        if (alive) {
            const unsigned char *list = g->order;
            if (kind == RT_BVH_RANGED) {
                list += active;
                alive = rti_last_hit(g, &door, active, flags, job, depth) - active;
            }
            rti_large_leaf(accel, g, node, list, alive, inst, job, flags & RTI_WALK_COUNT ? depth : 0);
            if (!g->open) return;
        }
        if (!top) return;
        node = stack[--top].node;
        active = stack[top].active;
        depth = stack[top].depth;
    }
}

#define RTI_LARGE_WALK(name, kind, flags)                                                                          \
    RTI_NOINLINE RTI_TARGET void name(const rt_accel *accel, rti_large *g, uint32_t inst, const rti_job *job)      \
    {                                                                                                              \
        rti_large_body(accel, g, inst, kind, flags, job);                                                          \
    }
RTI_LARGE_WALK(rti_walk_masked, RT_BVH_MASKED, 0)
RTI_LARGE_WALK(rti_walk_ranged, RT_BVH_RANGED, 0)
RTI_LARGE_WALK(rti_walk_partition, RT_BVH_PARTITION, 0)
#if RTI_STATS
RTI_LARGE_WALK(rti_walk_masked_count, RT_BVH_MASKED, RTI_WALK_COUNT)
RTI_LARGE_WALK(rti_walk_ranged_count, RT_BVH_RANGED, RTI_WALK_COUNT)
RTI_LARGE_WALK(rti_walk_partition_count, RT_BVH_PARTITION, RTI_WALK_COUNT)
#endif
#undef RTI_LARGE_WALK

/* Lanes that are not live get the org, dir and rdir of one that is, so that what bounds all rays need not leave them out, and no interval. False:
   none is live. */
RTI_FN bool rti_close_lanes(rti_large *g)
{
    const rti_packet *model = NULL;
    int i, lane = 0, k, j;
    g->open = 0;
    for (i = 0; i < g->count; i++) {
        if (!g->rays[i].live) continue;
        g->open++;
        if (!model) {
            model = &g->rays[i];
            lane = rti_lowest_bit(model->live);
        }
    }
    if (!model) return false;
    for (i = 0; i < g->count; i++) {
        rti_packet *p = &g->rays[i];
        if (p->live == RTI_ALL_LANES) continue;
        if (!p->live) {
            *p = *model;
            p->live = p->found = 0;
        }
        for (j = 0; j < RTI_WIDTH; j++) {
            if (p->live >> j & 1) continue;
            for (k = 0; k < 3; k++) {
                p->org[k][j] = model->org[k][lane];
                p->dir[k][j] = model->dir[k][lane];
                p->rdir[k][j] = model->rdir[k][lane];
            }
            p->pad[j] = model->pad[lane];
            p->tmin[j] = RTI_INFINITY;
            p->t[j] = -RTI_INFINITY;
        }
    }
    return true;
}

/* SIMD rays with live and found set, t and so on as rti_load_rays leaves them, through a BVH that is not empty. */
RTI_NOINLINE RTI_TARGET void rti_large_walk(const rt_accel *accel, rti_large *g, uint32_t inst, const rti_job *job)
{
    int i;
    if (!g->shared && !rti_close_lanes(g)) return;
#if RTI_PLANES
    for (i = 0; i < g->count && accel->plane_count; i++)
        if (g->rays[i].live) rti_note(g, &g->rays[i], rti_hit_planes(accel, &g->rays[i], g->rays[i].live, inst, job), job->query == RT_ANY);
#endif
    if (!accel->node_count) return;
    rti_make_frustum(accel, g, job->cull);
    for (i = 0; i < g->count; i++) g->order[i] = (unsigned char)i;
#if RTI_STATS
    if (job->stats) {
        (job->large == RT_BVH_MASKED ? rti_walk_masked_count : job->large == RT_BVH_RANGED ? rti_walk_ranged_count
                                     : rti_walk_partition_count)(accel, g, inst, job);
        return;
    }
#endif
    (job->large == RT_BVH_MASKED ? rti_walk_masked : job->large == RT_BVH_RANGED ? rti_walk_ranged : rti_walk_partition)(accel, g, inst, job);
}

#endif /* RTI_WIDTH > 1 && RTI_BVH */

/* ---- >>crowds -------------------------------------------------------------------------------------------------------- */

#if RTI_WIDTH > 1 && RTI_BVH

/* Packets of RT_BVH_WIDE: up to 256 rays. 8 children are asked with what bounds all rays, see rti_interval, then a child that is left with what
   bounds each of 8 SIMD rays; so are the triangles of a leaf ([Boulos] 4). One or two SIMD rays that are left go on as such.
   A crowd is of one octant, and of SIMD rays that are much smaller than all: one half of whose rays start on the table and half on the floor,
   or of rays that nothing holds together, would be asked about everything between. Such SIMD rays go by themselves. */

#define RTI_CROWD (256 / RTI_WIDTH)         /* SIMD rays, at most 64: a set of them is a uint64_t */
#define RTI_CROWDED 1.4f                    /* how much larger one may be than its share of the packet's width */

typedef struct {
    rti_packet *rays;
    uint64_t list;                          /* those of the crowd */
    int open;                               /* and how many of them still need hits */
    const int *side;                        /* of all */
    float near_org[3][RTI_CROWD], far_org[3][RTI_CROWD], least[3][RTI_CROWD], most[3][RTI_CROWD];       /* of each: its interval; */
    float tmin[RTI_CROWD], t[RTI_CROWD];    /* from where to where it needs hits */
    rti_interval all;
    float farthest;
} rti_crowd;

RTI_FN int rti_lowest_of(uint64_t bits)
{
#if defined(__GNUC__) || defined(__clang__)
    return __builtin_ctzll(bits);
#else
    return (uint32_t)bits ? rti_lowest_bit((uint32_t)bits) : 32 + rti_lowest_bit((uint32_t)(bits >> 32));
#endif
}

/* Rays of list that need hits. */
RTI_FN uint64_t rti_count_list(const rti_packet *rays, uint64_t list)
{
    uint64_t n = 0;
    for (; list; list &= list - 1) n += (uint64_t)rti_bit_count(rays[rti_lowest_of(list)].live);
    return n;
}

/* Of RTI_WIDTH SIMD rays the least of a number of theirs, field in the first of them; of those that are not of the crowd, whose lives are 0,
   infinity. */
RTI_FN rti_v rti_crowd_least(const float *field, const unsigned lives[RTI_WIDTH], bool whole)
{
    rti_v x[RTI_WIDTH];
    int i;
    RTI_UNROLL
    for (i = 0; i < RTI_WIDTH; i++) {
        x[i] = rti_vload((const float *)(const void *)((const char *)field + (size_t)i * sizeof(rti_packet)));
        if (!whole) x[i] = rti_vselect(lives[i], x[i], rti_vset(RTI_INFINITY));
    }
    return rti_vleasts(x);
}

/* And the greatest. */
RTI_FN rti_v rti_crowd_most(const float *field, const unsigned lives[RTI_WIDTH], bool whole)
{
    rti_v x[RTI_WIDTH];
    int i;
    RTI_UNROLL
    for (i = 0; i < RTI_WIDTH; i++) {
        x[i] = rti_vsub(rti_vset(0), rti_vload((const float *)(const void *)((const char *)field + (size_t)i * sizeof(rti_packet))));
        if (!whole) x[i] = rti_vselect(lives[i], x[i], rti_vset(RTI_INFINITY));
    }
    return rti_vsub(rti_vset(0), rti_vleasts(x));
}

/* Makes one of those of list, of the octant of side, that are much smaller than all. rays has room for RTI_CROWD. */
RTI_FN void rti_make_crowd(rti_crowd *c, rti_packet *rays, uint64_t list, const int *side, const float part)
{
    const rti_v high = rti_vset(RTI_INFINITY), low = rti_vset(-RTI_INFINITY), one = rti_vset(1);
    rti_v tmin = high, t = low, pads = rti_vset(0), org[3][2], rdir[3][2];
    float far_apart = 0, astray = 0;
    uint64_t left;
    int i, j, k;
    c->rays = rays;
    c->side = side;
    for (k = 0; k < 3; k++) {
        org[k][0] = rdir[k][0] = high;
        org[k][1] = rdir[k][1] = low;
    }
    for (i = 0; i < RTI_CROWD; i += RTI_WIDTH) {
        const rti_packet *p = rays + i;
        unsigned lives[RTI_WIDTH], all = RTI_ALL_LANES;
        bool whole;
        rti_v first, last, pad;
        if (!(list >> i & RTI_ALL_LANES)) {
            rti_vstore(c->tmin + i, high);
            rti_vstore(c->t + i, low);
            continue;
        }
        for (j = 0; j < RTI_WIDTH; j++) all &= lives[j] = list >> (i + j) & 1 ? p[j].live : 0;
        whole = all == RTI_ALL_LANES;
        first = rti_crowd_least(p->tmin, lives, whole);
        last = rti_crowd_most(p->t, lives, whole);
        pad = rti_vmax(rti_crowd_most(p->pad, lives, whole), rti_vset(0));
        rti_vstore(c->tmin + i, first);
        rti_vstore(c->t + i, last);
        tmin = rti_vmin(first, tmin);
        t = rti_vmax(last, t);
        pads = rti_vmax(pad, pads);
        for (k = 0; k < 3; k++) {
            const rti_v begin = rti_vsub(rti_crowd_least(p->org[k], lives, whole), pad), end = rti_vadd(rti_crowd_most(p->org[k], lives, whole), pad);
            const rti_v least = rti_crowd_least(p->rdir[k], lives, whole), most = rti_crowd_most(p->rdir[k], lives, whole);
            rti_vstore(c->near_org[k] + i, side[k] ? begin : end);
            rti_vstore(c->far_org[k] + i, side[k] ? end : begin);
            rti_vstore(c->least[k] + i, least);
            rti_vstore(c->most[k] + i, most);
            org[k][0] = rti_vmin(begin, org[k][0]);
            org[k][1] = rti_vmax(end, org[k][1]);
            rdir[k][0] = rti_vmin(least, rdir[k][0]);
            rdir[k][1] = rti_vmax(most, rdir[k][1]);
        }
    }
    c->farthest = rti_vmost(t);
    c->all.tmin = rti_vset(rti_vleast(tmin));
    for (k = 0; k < 3; k++) {
        const float begin = rti_vleast(org[k][0]), end = rti_vmost(org[k][1]), least = rti_vleast(rdir[k][0]), most = rti_vmost(rdir[k][1]);
        c->all.near_org[k] = rti_vset(side[k] ? begin : end);
        c->all.far_org[k] = rti_vset(side[k] ? end : begin);
        c->all.least[k] = rti_vset(least);
        c->all.most[k] = rti_vset(most);
        far_apart = rti_maxf(far_apart, end - begin);
        astray = rti_maxf(astray, 1 / least - 1 / most);
    }
    far_apart = part * far_apart + 4 * rti_vmost(pads);
    astray *= part;
    c->list = list;
    for (i = 0; i < RTI_CROWD; i += RTI_WIDTH) {
        unsigned tight = RTI_ALL_LANES;
        if (!(list >> i & RTI_ALL_LANES)) continue;
        for (k = 0; k < 3; k++) {
            tight &= rti_vle(rti_vabs(rti_vsub(rti_vload(c->near_org[k] + i), rti_vload(c->far_org[k] + i))), rti_vset(far_apart));
            tight &= rti_vle(rti_vsub(rti_vdiv(one, rti_vload(c->least[k] + i)), rti_vdiv(one, rti_vload(c->most[k] + i))), rti_vset(astray));
        }
        c->list &= ~((uint64_t)(RTI_ALL_LANES & ~tight) << i);
    }
    c->open = 0;
    for (left = c->list; left; left &= left - 1) c->open++;
}

/* Those of list that may meet a box. */
RTI_FN uint64_t rti_crowd_meets(const rti_crowd *c, uint64_t list, const rti_v near_side[3], const rti_v far_side[3])
{
    uint64_t met = 0;
    int i, k;
    for (i = 0; i < RTI_CROWD; i += RTI_WIDTH) {
        rti_interval r;
        rti_v enter;
        if (!(list >> i & RTI_ALL_LANES)) continue;
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            r.near_org[k] = rti_vload(c->near_org[k] + i);
            r.far_org[k] = rti_vload(c->far_org[k] + i);
            r.least[k] = rti_vload(c->least[k] + i);
            r.most[k] = rti_vload(c->most[k] + i);
        }
        r.tmin = rti_vload(c->tmin + i);
        met |= (uint64_t)rti_cross_interval(&r, near_side, far_side, rti_vload(c->t + i), &enter) << i;
    }
    return met & list;
}

/* Does a ray of a SIMD ray meet a box? */
RTI_FN bool rti_crowd_enters(const rti_crowd *c, int i, const rti_v near_side[3], const rti_v far_side[3])
{
    return (rti_meet_lanes(&c->rays[i], near_side, far_side) & c->rays[i].live) != 0;
}

/* Notes what a SIMD ray has hit; with RT_ANY those lanes are done. */
RTI_FN void rti_crowd_note(rti_crowd *c, int i, unsigned hit, const bool any)
{
    rti_packet *p = &c->rays[i];
    if (!hit) return;
    p->found |= hit;
    if (any) {
        p->live &= ~hit;
        if (p->live) return;
        c->open--;
    }
    c->t[i] = rti_vmost(rti_vselect(p->live, rti_vload(p->t), rti_vset(-RTI_INFINITY)));
}

RTI_FN void rti_crowd_octet(rti_crowd *c, uint64_t list, const rti_octet *octet, uint32_t count, uint32_t inst, const int flags, const rti_job *job)
{
    const bool any = (flags & RTI_WALK_ANY) != 0;
    uint32_t at;
    (void)job;
    for (at = 0; at < RTI_CHILDREN && at < count; at += RTI_WIDTH) {
        float nears[3][RTI_WIDTH], fars[3][RTI_WIDTH];
        rti_v near_side[3], far_side[3], enter;
        unsigned kept;
        int k;
        rti_octet_boxes(octet, at, c->side, near_side, far_side);
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            rti_vstore(nears[k], near_side[k]);
            rti_vstore(fars[k], far_side[k]);
        }
        kept = rti_cross_interval(&c->all, near_side, far_side, rti_vset(c->farthest), &enter);
        if (at + RTI_WIDTH > count) kept &= (1u << (count - at)) - 1;
        for (; kept; kept &= kept - 1) {
            const int lane = rti_lowest_bit(kept);
            const uint32_t j = at + (uint32_t)lane;
            uint64_t asked;
            RTI_UNROLL
            for (k = 0; k < 3; k++) {
                near_side[k] = rti_vset(nears[k][lane]);
                far_side[k] = rti_vset(fars[k][lane]);
            }
            for (asked = rti_crowd_meets(c, list, near_side, far_side); asked; asked &= asked - 1) {
                const int i = rti_lowest_of(asked);
                rti_packet *p = &c->rays[i];
                unsigned hit = 0;
                int kz;
                RTI_TALLY(job->stats, flags, prims, rti_bit_count(p->live));
                for (kz = p->first_axis; kz <= p->last_axis; kz++) {
                    const unsigned lanes = p->live & p->axis[kz];
                    rti_shear shear;
                    if (!lanes) continue;
                    shear = rti_make_shear(p, kz);
                    hit |= rti_hit_triangle(p, &shear, lanes, octet->v[0] + j, RTI_CHILDREN, octet->prim[j], inst, any ? RTI_WALK_ANY : 0);
                }
                rti_crowd_note(c, i, hit, any);
            }
        }
    }
}

RTI_NOINLINE RTI_TARGET void rti_walk_crowd(const rt_accel *accel, rti_packet *rays, int count, uint32_t inst, const rti_job *job);

#if RTI_SPHERES || RTI_INSTANCES
/* The spheres or instances of a leaf, which are dear: each ray is asked for its box first. Rays of a crowd go through an instance together. */
RTI_NOINLINE RTI_TARGET void rti_crowd_others(const rt_accel *accel, rti_crowd *c, uint64_t list, const rti_wide *node, int child, uint32_t inst,
                                              const rti_job *job)
{
    const bool any = job->query == RT_ANY;
    const uint32_t kind = node->count[child] >> RTI_KIND_SHIFT;
    uint32_t first = node->index[child], count = node->count[child] & RTI_COUNT_MASK;
    rti_v near_side[3], far_side[3];
    uint64_t left;
    (void)kind;
    rti_wide_box(node, child, c->side, near_side, far_side);      /* again: those of the walk stay in registers */
#if RTI_SPHERES
    for (left = kind == RTI_SPHERE ? list : 0; left; left &= left - 1) {
        const int i = rti_lowest_of(left);
        rti_packet *p = &c->rays[i];
        const unsigned lanes = p->live & rti_meet_lanes(p, near_side, far_side);
        RTI_TALLY(job->stats, RTI_COUNTS(job) ? RTI_WALK_COUNT : 0, prims, count * (uint32_t)rti_bit_count(lanes));
        if (lanes) rti_crowd_note(c, i, rti_hit_spheres(accel, p, lanes, NULL, first, count, inst, any ? RTI_WALK_ANY : 0), any);
    }
#endif
#if RTI_INSTANCES
    for (count = kind == RTI_INSTANCE ? count : 0; count; count--, first++) {
        const rti_instance *in = &accel->instances[first];
        rti_packet inner[RTI_CROWD];
        unsigned char from[RTI_CROWD];
        int n = 0, i;
        for (left = list; left; left &= left - 1) {
            rti_packet *p = &c->rays[i = rti_lowest_of(left)], *q = &inner[n];
            const unsigned lanes = p->live & rti_meet_lanes(p, near_side, far_side);
            RTI_TALLY(job->stats, RTI_COUNTS(job) ? RTI_WALK_COUNT : 0, prims, rti_bit_count(lanes));
            q->live = lanes ? rti_enter_instance(in, in->accel, p, lanes, q, false) : 0;
            q->found = 0;
            if (q->live) from[n++] = (unsigned char)i;
        }
        rti_walk_crowd(in->accel, inner, n, inst + 1 + in->base, job);
        for (i = 0; i < n; i++) {
            if (!any) rti_leave_instance(&c->rays[from[i]], &inner[i], inner[i].found);
            rti_crowd_note(c, from[i], inner[i].found, any);
        }
    }
#endif
}
#endif

/* A SIMD ray goes on alone. */
RTI_FN void rti_crowd_part(const rt_accel *accel, rti_crowd *c, int i, uint32_t index, uint32_t inst, const bool any, const rti_job *job)
{
    rti_packet *p = &c->rays[i];
    rti_interval r;
    int k;
    r.tmin = rti_vset(c->tmin[i]);
    RTI_UNROLL
    for (k = 0; k < 3; k++) {
        r.near_org[k] = rti_vset(c->near_org[k][i]);
        r.far_org[k] = rti_vset(c->far_org[k][i]);
        r.least[k] = rti_vset(c->least[k][i]);
        r.most[k] = rti_vset(c->most[k][i]);
    }
    rti_crowd_note(c, i, any ? rti_sheaf_any(accel, p, p->live, &r, index, inst, job) : rti_sheaf_closest(accel, p, p->live, &r, index, inst, job),
                   any);
}

/* From near to far: what waits lies on a stack, with the SIMD rays that met its parent. Intervals of rays that go nearly along a plane are so
   wide that they miss hardly a box; so that no node is visited for them alone, the first SIMD ray must meet it by itself, or is left behind
   ([Overbeck] 3.2). */
RTI_FN void rti_crowd_body(const rt_accel *accel, rti_crowd *c, uint32_t inst, const int flags, const rti_job *job)
{
    const bool any = (flags & RTI_WALK_ANY) != 0;
    struct { uint64_t list; const rti_wide *node; float enter; int child; } stack[RTI_WIDE_STACK];
    uint64_t list = c->list;
    uint32_t index = 0;
    int top = 0;
    for (;;) {
        const rti_wide *node = accel->wides + index;
        const int base = top;
        float enter[RTI_CHILDREN];
        rti_v near_side[3], far_side[3], first;
        unsigned hit = 0;
        int i;
        for (i = 0; i < RTI_CHILDREN; i += RTI_WIDTH) {
            rti_wide_boxes(node, i, c->side, near_side, far_side);
            hit |= rti_cross_interval(&c->all, near_side, far_side, rti_vset(c->farthest), &first) << i;
            rti_vstore(enter + i, first);
        }
#if RTI_STATS
        if (flags & RTI_WALK_COUNT) {
            const uint64_t rays = rti_count_list(c->rays, list);
            job->stats->steps++;
            job->stats->nodes += rays;
            job->stats->active += rays;
            job->stats->frusta += RTI_CHILDREN;
            job->stats->culled += (uint64_t)(RTI_CHILDREN - rti_bit_count(hit));
            job->stats->pushes += (uint64_t)rti_bit_count(hit);
        }
#endif
        for (; hit; hit &= hit - 1) {
            const int next = rti_lowest_bit(hit);
            int at = top++;
            for (; at > base && stack[at - 1].enter < enter[next]; at--) stack[at] = stack[at - 1];
            stack[at].list = list;
            stack[at].node = node;
            stack[at].enter = enter[next];
            stack[at].child = next;
        }
        for (;;) {
            uint64_t some;
            uint32_t count, n;
            if (!top) return;
            node = stack[--top].node;
            i = stack[top].child;
            rti_wide_box(node, i, c->side, near_side, far_side);
            RTI_TALLY(job->stats, flags, boxes, rti_count_list(c->rays, stack[top].list));
            list = rti_crowd_meets(c, stack[top].list, near_side, far_side);
            while (list && !rti_crowd_enters(c, rti_lowest_of(list), near_side, far_side)) list &= list - 1;
            if (!list) continue;
            index = node->index[i];
            count = node->count[i];
            n = count & RTI_COUNT_MASK;
            some = list & (list - 1);
            if (!count && some & (some - 1)) break;         /* one or two SIMD rays go on alone */
#if RTI_STATS
            if (flags & RTI_WALK_COUNT && count) {
                const uint64_t rays = rti_count_list(c->rays, list);
                job->stats->steps++;
                job->stats->leaves += rays;
                job->stats->active += rays;
            }
#endif
            if (!count)
                for (; list; list &= list - 1) rti_crowd_part(accel, c, rti_lowest_of(list), index, inst, any, job);
            else if (count >> RTI_KIND_SHIFT == RTI_TRIANGLE) {
                rti_octet gathered;
                const rti_octet *octet = &gathered;
                if (accel->octets) octet = accel->octets + index;
                else rti_gather_octet(accel, index, n, &gathered);
                rti_crowd_octet(c, list, octet, n, inst, flags, job);
            }
#if RTI_SPHERES || RTI_INSTANCES
            else rti_crowd_others(accel, c, list, node, i, inst, job);
#endif
            if (any && !c->open) return;
        }
    }
}

#define RTI_CROWD_WALK(name, flags)                                                                          \
    RTI_NOINLINE RTI_TARGET void name(const rt_accel *accel, rti_crowd *c, uint32_t inst, const rti_job *job) \
    {                                                                                                        \
        rti_crowd_body(accel, c, inst, flags, job);                                                          \
    }
RTI_CROWD_WALK(rti_crowd_closest, 0)
RTI_CROWD_WALK(rti_crowd_any, RTI_WALK_ANY)
#if RTI_STATS
RTI_CROWD_WALK(rti_crowd_closest_count, RTI_WALK_COUNT)
RTI_CROWD_WALK(rti_crowd_any_count, RTI_WALK_ANY | RTI_WALK_COUNT)
#endif
#undef RTI_CROWD_WALK

/* SIMD rays, prepared, with live and found set. */
RTI_NOINLINE RTI_TARGET void rti_walk_crowd(const rt_accel *accel, rti_packet *rays, int count, uint32_t inst, const rti_job *job)
{
    const bool any = job->query == RT_ANY;
    uint64_t left = 0, alone = 0, list;
    int i;
    for (i = 0; i < count; i++) {
        if (!rays[i].live) continue;
#if RTI_PLANES
        if (RTI_UNLIKELY(accel->plane_count)) {
            const unsigned found = rti_hit_planes(accel, &rays[i], rays[i].live, inst, job);
            rays[i].found |= found;
            if (any) rays[i].live &= ~found;
        }
#endif
        if (rays[i].live) left |= (uint64_t)1 << i;
    }
    if (!job->wide || !accel->node_count || accel->structure != RT_BVH || !accel->wides) {
        alone = left;
        left = 0;
    }
    while (left) {
        const rti_packet *p = &rays[i = rti_lowest_of(left)];
        rti_crowd c;
        for (list = 0; i < count; i++) {
            const rti_packet *q = &rays[i];
            if (!(left >> i & 1) || !q->uniform) continue;
            if (q->side[0] == p->side[0] && q->side[1] == p->side[1] && q->side[2] == p->side[2]) list |= (uint64_t)1 << i;
        }
        if (!p->uniform || !(list & (list - 1))) {
            alone |= left & (~left + 1);
            left &= left - 1;
            continue;
        }
        left &= ~list;
        rti_make_crowd(&c, rays, list, p->side, (float)(RTI_CROWDED * RTI_PACKET_COLUMNS(RTI_WIDTH)) / (float)job->side);
        if (!(c.list & (c.list - 1))) c.list = 0;
        alone |= list & ~c.list;
        if (!c.list) continue;
#if RTI_STATS
        if (job->stats) {
            if (any) rti_crowd_any_count(accel, &c, inst, job);
            else rti_crowd_closest_count(accel, &c, inst, job);
            continue;
        }
#endif
        if (any) rti_crowd_any(accel, &c, inst, job);
        else rti_crowd_closest(accel, &c, inst, job);
    }
    for (; alone; alone &= alone - 1) {
        rti_packet *p = &rays[rti_lowest_of(alone)];
        if (p->live) p->found |= rti_tree_walker(accel, job)(accel, p, p->live, inst, job);
    }
}

#endif /* RTI_WIDTH > 1 && RTI_BVH */


/* ---- >>batch -------------------------------------------------------------------------------------------------------- */

/* Rays as they stand in memory to lanes: a transpose. */
RTI_FN void rti_load_rays(const rt_ray *rays, rti_packet *p)
{
#if RTI_LANES == RTI_LANES_SSE2
    int half;
    RTI_UNROLL
    for (half = 0; half < 2; half++) {      /* org and tmin, then dir and tmax */
        const float *at = (const float *)(const void *)rays + 4 * half;
        __m128 x = _mm_loadu_ps(at), y = _mm_loadu_ps(at + 8), z = _mm_loadu_ps(at + 16), w = _mm_loadu_ps(at + 24);
        _MM_TRANSPOSE4_PS(x, y, z, w);
        rti_vstore(half ? p->dir[0] : p->org[0], x);
        rti_vstore(half ? p->dir[1] : p->org[1], y);
        rti_vstore(half ? p->dir[2] : p->org[2], z);
        rti_vstore(half ? p->t : p->tmin, w);
    }
#elif RTI_LANES == RTI_LANES_AVX2
    const float *at = (const float *)(const void *)rays;     /* 8 floats a ray */
    __m256 row[4], x, y, z, w;
    int half, i;
    RTI_UNROLL
    for (half = 0; half < 2; half++) {
        RTI_UNROLL
        for (i = 0; i < 4; i++)             /* rays i and i + 4 side by side: two 4 x 4 transposes in one */
            row[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(at + 8 * i + 4 * half)),
                                          _mm_loadu_ps(at + 8 * i + 32 + 4 * half), 1);
        x = _mm256_unpacklo_ps(row[0], row[2]);
        y = _mm256_unpackhi_ps(row[0], row[2]);
        z = _mm256_unpacklo_ps(row[1], row[3]);
        w = _mm256_unpackhi_ps(row[1], row[3]);
        rti_vstore(half ? p->dir[0] : p->org[0], _mm256_unpacklo_ps(x, z));
        rti_vstore(half ? p->dir[1] : p->org[1], _mm256_unpackhi_ps(x, z));
        rti_vstore(half ? p->dir[2] : p->org[2], _mm256_unpacklo_ps(y, w));
        rti_vstore(half ? p->t : p->tmin, _mm256_unpackhi_ps(y, w));
    }
#else
    int i;
    for (i = 0; i < RTI_WIDTH; i++) {
        p->org[0][i] = rays[i].org.x;
        p->org[1][i] = rays[i].org.y;
        p->org[2][i] = rays[i].org.z;
        p->tmin[i] = rays[i].tmin;
        p->dir[0][i] = rays[i].dir.x;
        p->dir[1][i] = rays[i].dir.y;
        p->dir[2][i] = rays[i].dir.z;
        p->t[i] = rays[i].tmax;
    }
#endif
}

/* n floats from first on, at most RTI_WIDTH; the last of them again in the lanes that are left. */
RTI_FN rti_v rti_take_lanes(const float *from, size_t first, int n)
{
    float padded[RTI_WIDTH];
    int i;
    if (n == RTI_WIDTH) return rti_vload(from + first);
    for (i = 0; i < RTI_WIDTH; i++) padded[i] = from[first + (size_t)(i < n ? i : n - 1)];
    return rti_vload(padded);
}

/* Fills p from n of a call's rays, at most RTI_WIDTH, from first on; answers their lanes. Missing rays repeat the last and are not traced.
   */
RTI_FN unsigned rti_take_rays(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t first, int n, rti_packet *p)
{
    const rt_ray_arrays *from = job->from;
#if RTI_INSTANCES
    if (RTI_UNLIKELY(accel->moves)) {
        int i;
        for (i = 0; i < RTI_WIDTH; i++) p->time[i] = job->times ? rti_clamp_time(job->times[first + (size_t)(i < n ? i : n - 1)]) : 0;
    }
#else
    (void)accel;
#endif
    if (from) {
        int k;
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            rti_vstore(p->org[k], from->one_org ? rti_vset(from->org[k][0]) : rti_take_lanes(from->org[k], first, n));
            rti_vstore(p->dir[k], rti_take_lanes(from->dir[k], first, n));
        }
        rti_vstore(p->tmin, from->tmin ? rti_take_lanes(from->tmin, first, n) : rti_vset(0));
        rti_vstore(p->t, from->tmax ? rti_take_lanes(from->tmax, first, n) : rti_vset(RTI_INFINITY));
    } else if (RTI_WIDTH > 1 && n == 1) {   /* by rt_intersect and rt_occluded */
        const rt_ray *ray = rays + first;
        const float org[3] = { ray->org.x, ray->org.y, ray->org.z }, dir[3] = { ray->dir.x, ray->dir.y, ray->dir.z };
        int k;
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            rti_vstore(p->org[k], rti_vset(org[k]));
            rti_vstore(p->dir[k], rti_vset(dir[k]));
        }
        rti_vstore(p->tmin, rti_vset(ray->tmin));
        rti_vstore(p->t, rti_vset(ray->tmax));
    } else if (n < RTI_WIDTH) {
        rt_ray padded[RTI_WIDTH];
        int i;
        for (i = 0; i < RTI_WIDTH; i++) padded[i] = rays[first + (size_t)(i < n ? i : n - 1)];
        rti_load_rays(padded, p);
    } else rti_load_rays(rays + first, p);
    rti_no_hits(p);
    return RTI_ALL_LANES >> (RTI_WIDTH - n);
}

/* n lanes of a to to from first on, where they are wanted. */
RTI_FN void rti_give_lanes(void *to, size_t first, int n, rti_v a)
{
    float row[RTI_WIDTH];
    if (!to) return;
    if (n == RTI_WIDTH) {
        rti_vstore((float *)to + first, a);
        return;
    }
    rti_vstore(row, a);
    memcpy((float *)to + first, row, (size_t)n * sizeof(float));
}

/* The hits of n lanes, from first on. Lanes that have found nothing still have u = v = prim = inst = 0; with RT_ANY all have. */
RTI_FN void rti_give_hits(const rti_job *job, const rti_packet *p, unsigned found, rt_hit *hits, size_t first, int n)
{
    const bool any = job->query == RT_ANY;
    const rt_hit_arrays *to = job->to;
    const rti_v none = rti_vid(RT_NONE);
    rti_v t, prim, inst;
    float row[5][RTI_WIDTH];
    int i;
    if (RTI_WIDTH > 1 && n == 1 && !to) {
        hits += first;
        rti_set_miss(hits);
        if (!found) return;
        hits->t = any ? 0 : p->t[0];
        hits->u = p->u[0];
        hits->v = p->v[0];
        hits->prim = p->prim.id[0];
        if (!any) hits->inst = p->inst.id[0];
        return;
    }
    t = rti_vselect(found, any ? rti_vset(0) : rti_vload(p->t), rti_vset(RTI_INFINITY));
    prim = rti_vselect(found, rti_vload(p->prim.bits), none);
    inst = any ? none : rti_vselect(found, rti_vload(p->inst.bits), none);
    if (to) {
        rti_give_lanes(to->t, first, n, t);
        rti_give_lanes(to->u, first, n, rti_vload(p->u));
        rti_give_lanes(to->v, first, n, rti_vload(p->v));
        rti_give_lanes(to->prim, first, n, prim);
        rti_give_lanes(to->inst, first, n, inst);
        return;
    }
    hits += first;
    rti_vstore(row[4], inst);
#if RTI_LANES == RTI_LANES_SSE2
    if (n == RTI_WIDTH) {                   /* t u v prim of a hit are stored at once: a transpose */
        __m128 a = t, b = rti_vload(p->u), c = rti_vload(p->v), d = prim;
        _MM_TRANSPOSE4_PS(a, b, c, d);
        _mm_storeu_ps(&hits[0].t, a);
        _mm_storeu_ps(&hits[1].t, b);
        _mm_storeu_ps(&hits[2].t, c);
        _mm_storeu_ps(&hits[3].t, d);
        RTI_UNROLL
        for (i = 0; i < RTI_WIDTH; i++) memcpy(&hits[i].inst, &row[4][i], sizeof(float));
        return;
    }
#elif RTI_LANES == RTI_LANES_AVX2
    if (n == RTI_WIDTH) {
        const __m256 u = rti_vload(p->u), v = rti_vload(p->v);
        const __m256 tv_lo = _mm256_unpacklo_ps(t, v), tv_hi = _mm256_unpackhi_ps(t, v);
        const __m256 up_lo = _mm256_unpacklo_ps(u, prim), up_hi = _mm256_unpackhi_ps(u, prim);
        const __m256 pair[4] = { _mm256_unpacklo_ps(tv_lo, up_lo), _mm256_unpackhi_ps(tv_lo, up_lo),
                                 _mm256_unpacklo_ps(tv_hi, up_hi), _mm256_unpackhi_ps(tv_hi, up_hi) };
        RTI_UNROLL
        for (i = 0; i < 4; i++) {           /* hits i and i + 4 */
            _mm_storeu_ps(&hits[i].t, _mm256_castps256_ps128(pair[i]));
            _mm_storeu_ps(&hits[i + 4].t, _mm256_extractf128_ps(pair[i], 1));
        }
        RTI_UNROLL
        for (i = 0; i < RTI_WIDTH; i++) memcpy(&hits[i].inst, &row[4][i], sizeof(float));
        return;
    }
#endif
    rti_vstore(row[0], t);
    rti_vstore(row[1], rti_vload(p->u));
    rti_vstore(row[2], rti_vload(p->v));
    rti_vstore(row[3], prim);
    for (i = 0; i < n; i++) {
        hits[i].t = row[0][i];
        hits[i].u = row[1][i];
        hits[i].v = row[2][i];
        memcpy(&hits[i].prim, &row[3][i], sizeof(float));
        memcpy(&hits[i].inst, &row[4][i], sizeof(float));
    }
}

RTI_FN void rti_batch_run(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t first, size_t last, rt_hit *hits)
{
    const rti_walker walk = job->single ? (rti_walker)accel->single_walks[job->query] : rti_walker_of(accel, job);
    for (; first < last; first += RTI_WIDTH) {
        const int n = last - first < RTI_WIDTH ? (int)(last - first) : RTI_WIDTH;
        rti_packet p;
        const unsigned live = rti_prepare(accel, &p, rti_take_rays(accel, job, rays, first, n, &p), false);
#if RTI_STATS
        if (job->stats) job->stats->rays += (uint64_t)rti_bit_count(live);
#endif
        rti_give_hits(job, &p, live ? walk(accel, &p, live, RT_NONE, job) : 0, hits, first, n);
    }
}

RTI_NOINLINE RTI_TARGET void rti_batch(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rti_batch_run(accel, job, rays, 0, count, hits);
}

#if RTI_WIDTH > 1 && RTI_THREADED
/* RT_THREADED_PARALLEL: job->side rays at a time, 2 to 16. */
RTI_NOINLINE RTI_TARGET void rti_batch_parallel(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    const size_t side = (size_t)job->side;
    const rti_walker walk = rti_walker_of(accel, job);
    size_t first;
    for (first = 0; first < count; first += side) {
        const int n = count - first < side ? (int)(count - first) : (int)side;
        rti_packet p[RTI_GROUPS];
        unsigned live[RTI_GROUPS], found[RTI_GROUPS];
        int groups = 0, i;
        for (i = 0; i < n; i += RTI_WIDTH, groups++) {
            const int part = n - i < RTI_WIDTH ? n - i : RTI_WIDTH;
            live[groups] = rti_prepare(accel, &p[groups], rti_take_rays(accel, job, rays, first + (size_t)i, part, &p[groups]), false);
            found[groups] = 0;
#if RTI_STATS
            if (job->stats) job->stats->rays += (uint64_t)rti_bit_count(live[groups]);
#endif
        }
        if (groups == 1 || !accel->node_count)
            for (i = 0; i < groups; i++) found[i] = live[i] ? walk(accel, &p[i], live[i], RT_NONE, job) : 0;
        else {
#if RTI_PLANES
            for (i = 0; i < groups && accel->plane_count; i++) {
                found[i] = rti_hit_planes(accel, &p[i], live[i], RT_NONE, job);
                if (job->query == RT_ANY) live[i] &= ~found[i];
            }
#endif
            rti_thread_groups(accel, p, live, found, groups, job);
        }
        for (i = 0; i < groups; i++) {
            const int from = i * RTI_WIDTH;
            rti_give_hits(job, &p[i], found[i], hits, first + (size_t)from, n - from < RTI_WIDTH ? n - from : RTI_WIDTH);
        }
    }
}
#endif

#if RTI_WIDTH > 1 && RTI_BVH
/* A large packet is read in a burst, with long pauses, which processors do not foresee: what comes next is asked for meanwhile. */
RTI_FN void rti_fetch(const rt_ray *rays, const rt_hit *hits)
{
    int i;
    RTI_UNROLL
    for (i = 0; i < RTI_WIDTH; i += 2) RTI_PREFETCH(rays + i);          /* a line has 2 rays, or 3.2 hits */
    RTI_UNROLL
    for (i = 0; i < RTI_WIDTH; i += 3) RTI_PREFETCH(hits + i);
}

/* The rays from first to last, of count, in packets of side x side. */
RTI_FN void rti_batch_packets(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t first, size_t last, size_t count,
                              rt_hit *hits, rti_packet *packets)
{
    const size_t size = (size_t)job->side * (size_t)job->side;
    rti_large g;
    g.rays = packets;
    for (; first < last; first += size) {
        const int n = last - first < size ? (int)(last - first) : (int)size;
        int i;
        for (i = g.count = 0; i < n; i += RTI_WIDTH, g.count++) {
            rti_packet *p = &packets[g.count];
            p->live = rti_take_rays(accel, job, rays, first + (size_t)i, n - i < RTI_WIDTH ? n - i : RTI_WIDTH, p);
            p->found = 0;
        }
        g.open = g.count;
        g.shared = n % RTI_WIDTH == 0 && accel->node_count && rti_prepare_shared(accel, &g);
        for (i = 0; i < g.count && !g.shared; i++) packets[i].live = rti_prepare(accel, &packets[i], packets[i].live, true);
#if RTI_STATS
        for (i = 0; i < g.count && job->stats; i++) job->stats->rays += (uint64_t)rti_bit_count(packets[i].live);
#endif
        if (!rti_is_empty(accel)) rti_large_walk(accel, &g, RT_NONE, job);
        for (i = g.count = 0; i < n; i += RTI_WIDTH, g.count++) {
            const size_t at = first + (size_t)i;
            if (at + 3 * size < count && !job->from) rti_fetch(rays + at + 2 * size, hits + at + size);
            rti_give_hits(job, &packets[g.count], packets[g.count].found, hits, at, n - i < RTI_WIDTH ? n - i : RTI_WIDTH);
        }
    }
}

/* Packets of up to 16 x 16 rays, and of up to 32 x 32, which take four times the stack. */
RTI_NOINLINE RTI_TARGET void rti_batch_large(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rti_packet packets[RTI_SIMD_RAYS / 4];
    rti_batch_packets(accel, job, rays, 0, count, count, hits, packets);
}
RTI_NOINLINE RTI_TARGET void rti_batch_largest(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rti_packet packets[RTI_SIMD_RAYS];
    rti_batch_packets(accel, job, rays, 0, count, count, hits, packets);
}

/* RT_BVH_WIDE: the rays from first to last, of count, in packets of side x side. packets has room for RTI_CROWD. */
RTI_FN void rti_crowd_packets(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t first, size_t last, size_t count, rt_hit *hits,
                              rti_packet *packets)
{
    const size_t size = (size_t)job->side * (size_t)job->side;
    const rti_walker walk = rti_walker_of(accel, job);
    size_t begins[RTI_CROWD];
    for (; first < last; first += size) {
        const size_t end = last - first < size ? last : first + size;
        size_t at;
        int groups = 0, i;
        for (at = first; at < end; at += RTI_WIDTH) {
            const int n = end - at < RTI_WIDTH ? (int)(end - at) : RTI_WIDTH;
            rti_packet *p = &packets[groups];
            p->live = rti_prepare(accel, p, rti_take_rays(accel, job, rays, at, n, p), false);
            p->found = 0;
#if RTI_STATS
            if (job->stats) job->stats->rays += (uint64_t)rti_bit_count(p->live);
#endif
            if (p->live && p->uniform) begins[groups++] = at;
            else rti_give_hits(job, p, p->live ? walk(accel, p, p->live, RT_NONE, job) : 0, hits, at, n);     /* of several octants: while it is near */
        }
        if (!rti_is_empty(accel)) rti_walk_crowd(accel, packets, groups, RT_NONE, job);
        for (i = 0; i < groups; i++) {
            at = begins[i];
            if (at + 3 * size < count && !job->from) rti_fetch(rays + at + 2 * size, hits + at + size);
            rti_give_hits(job, &packets[i], packets[i].found, hits, at, end - at < RTI_WIDTH ? (int)(end - at) : RTI_WIDTH);
        }
    }
}

RTI_NOINLINE RTI_TARGET void rti_batch_crowds(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    rti_packet packets[RTI_CROWD];
    rti_crowd_packets(accel, job, rays, 0, count, count, hits, packets);
}

/* RT_AUTO on a BVH: crowds, where there are wide nodes; but SIMD rays or Ranged with culling ([Overbeck] Table 1) are faster for spheres or
   triangles that lie on top of each other, and all there is without wide nodes. Which is fastest is found by trying: now and then a packet of
   16 x 16 goes each way, by the clock, and the others as it was faster; one more goes before it, or the way in use, whose tree is in the caches,
   would look twice as fast as the others, whichever it is. Counts of nodes, boxes and triangles foretell the time within 40 % only, since
   coherence is in the branches too. Hits do not tell how they were found; rt_stats would, so with them, as without a clock, it is crowds, or
   else large packets for closest hits and SIMD rays for any. */
RTI_NOINLINE RTI_TARGET void rti_batch_auto(const rt_accel *accel, const rti_job *job, const rt_ray *rays, size_t count, rt_hit *hits)
{
    const bool timed = rti_ticks() && !job->stats, wide = accel->wides != NULL;
    rti_packet packets[RTI_SIMD_RAYS / 4];
    rti_tuner fresh, *tuner = job->tuner ? job->tuner : &fresh;
    rti_job part = *job;
    size_t first, last;
    bool warm = false;
    memset(&fresh, 0, sizeof fresh);
    part.large = RT_BVH_RANGED;
    part.side = 16;
    part.cull = RT_CULL_BOTH;
    if (!wide && tuner->next == RTI_BY_CROWDS) tuner->next = RTI_BY_SIMD;
    for (first = 0; first < count; first = last) {
        const size_t left = count - first, most = !timed ? left : tuner->rest ? (size_t)tuner->rest * RTI_AUTO_RAYS : RTI_AUTO_RAYS;
        const bool few = left < RTI_AUTO_RAYS / 4, trial = timed && !tuner->rest && !few;       /* few: they cannot stay together */
        int way = wide ? RTI_BY_CROWDS : job->query == RT_CLOSEST && !few ? RTI_BY_RANGED : RTI_BY_SIMD;
        uint64_t start = 0;
        warm = trial && !warm && left >= 2 * RTI_AUTO_RAYS;            /* then the next packet is timed */
        if (trial) {
            way = tuner->next;
            start = rti_ticks();
        } else if (timed && !few) way = rti_fastest_way(tuner, wide);
        last = left < most ? count : first + most;
        part.wide = way == RTI_BY_CROWDS;
        if (way == RTI_BY_CROWDS) rti_crowd_packets(accel, &part, rays, first, last, count, hits, packets);
        else if (way == RTI_BY_RANGED) rti_batch_packets(accel, &part, rays, first, last, count, hits, packets);
        else rti_batch_run(accel, &part, rays, first, last, hits);
        if (warm) continue;
        if (trial) rti_learn(tuner, wide, (float)(rti_ticks() - start) / (float)(last - first));
        else if (timed && !few) tuner->rest -= (unsigned)((last - first + RTI_AUTO_RAYS - 1) / RTI_AUTO_RAYS);
    }
}
#endif

/* ---- >>cover -------------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

#define RTI_COLUMNS RTI_PACKET_COLUMNS(RTI_WIDTH)
#define RTI_ROWS RTI_PACKET_ROWS(RTI_WIDTH)
#define RTI_SIDE RTI_COVER_SIDE(RTI_WIDTH)
#define RTI_ACROSS (RTI_SIDE / RTI_COLUMNS)
#define RTI_PACKET_COUNT (RTI_SIDE * RTI_SIDE / RTI_WIDTH)
#define RTI_QUEUE 64                        /* primitives */
#define RTI_FEW 3                           /* packets: so many are tested rather than thought about */

/* The vertices of RTI_WIDTH triangles as seen from the eye, and the largest distance of each along an axis. */
RTI_FN rti_v rti_triangles_from_eye(const rti_lens *lens, float corners[9][RTI_WIDTH], rti_v p[3][3])
{
    rti_v reach = rti_vset(0);
    int i, k;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) {
            p[i][k] = rti_vsub(rti_vload(corners[3 * i + k]), rti_vset((float)lens->eye[k]));
            reach = rti_vmax(rti_vabs(p[i][k]), reach);
        }
    return reach;
}

RTI_FN rti_v rti_wide_row(const rti_lens *lens, int row, const rti_v p[3])
{
    return rti_vadd(rti_vadd(rti_vmul(rti_vset((float)lens->rows[row][0]), p[0]), rti_vmul(rti_vset((float)lens->rows[row][1]), p[1])),
                    rti_vmul(rti_vset((float)lens->rows[row][2]), p[2]));
}

/* rti_see of good triangles that lie before the eye, RTI_WIDTH at a time in floats. The others get a negative depth. */
RTI_NOINLINE RTI_TARGET void rti_see_triangles(const rt_raster *r, size_t first, size_t count)
{
    const rti_lens *lens = &r->lens;
    const rti_v sway[2] = { rti_vset((float)lens->sway[0]), rti_vset((float)lens->sway[1]) };
    size_t at;
    for (at = first; at < first + count; at += RTI_WIDTH) {
        const int n = first + count - at < RTI_WIDTH ? (int)(first + count - at) : RTI_WIDTH;
        float corners[9][RTI_WIDTH], out[5][RTI_WIDTH], v[9];
        rti_v p[3][3], error[3], lo[2], hi[2], depth = rti_vset(RTI_INFINITY), deepest = rti_vset(-RTI_INFINITY), reach, beside[2];
        unsigned good = 0, unseen;
        int i, k;
        for (i = 0; i < RTI_WIDTH; i++) {
            if (i < n && rti_fetch_triangle(&r->accel.geo, at + (size_t)i, v)) good |= 1u << i;
            else memset(v, 0, sizeof v);
            for (k = 0; k < 9; k++) corners[k][i] = v[k];
        }
        for (k = 0; k < 9; k++) good &= rti_vle(rti_vabs(rti_vload(corners[k])), rti_vset(RT_MAX_COORDINATE));
        reach = rti_triangles_from_eye(lens, corners, p);
        reach = rti_vmul(rti_vadd(reach, rti_vset((float)lens->tiny)), rti_vset(1.9073486328125e-06f));
        for (k = 0; k < 3; k++) error[k] = rti_vmul(reach, rti_vset((float)lens->sums[k]));
        for (k = 0; k < 2; k++) {
            lo[k] = rti_vset(RTI_INFINITY);
            hi[k] = rti_vset(-RTI_INFINITY);
        }
        for (i = 0; i < 3; i++) {
            const rti_v c = rti_wide_row(lens, 2, p[i]), nearest = rti_vsub(c, error[2]), rdepth = rti_vdiv(rti_vset(1), c);
            const rti_v grow = rti_vdiv(rti_vset(1), nearest);
            depth = rti_vmin(nearest, depth);
            deepest = rti_vmax(c, deepest);
            for (k = 0; k < 2; k++) {
                rti_v x = rti_vmul(rti_wide_row(lens, k, p[i]), rdepth);
                rti_v off = rti_vmul(rti_vadd(error[k], rti_vmul(rti_vabs(x), error[2])), grow);
                lo[k] = rti_vmin(rti_vsub(x, off), lo[k]);
                hi[k] = rti_vmax(rti_vadd(x, off), hi[k]);
            }
        }
        unseen = good & rti_vlt(rti_vadd(deepest, error[2]), rti_vset(0));              /* behind the eye */
        good &= unseen | rti_vlt(rti_vset(0), depth);
        for (k = 0; k < 2; k++) {
            good &= unseen | (rti_vlt(rti_vset(-1e30f), lo[k]) & rti_vlt(hi[k], rti_vset(1e30f)));      /* no overflow */
            lo[k] = rti_vsub(lo[k], sway[k]);
            hi[k] = rti_vadd(hi[k], sway[k]);
            unseen |= rti_vlt(hi[k], rti_vset(0)) | rti_vlt(rti_vset(lens->edge[k]), lo[k]);
            beside[k] = rti_vmax(lo[k], rti_vset(-1));
            hi[k] = rti_vmin(hi[k], rti_vset(lens->edge[k] + 1));
        }
        rti_vstore(out[0], rti_vselect(unseen, rti_vset(1), beside[0]));
        rti_vstore(out[1], beside[1]);
        rti_vstore(out[2], rti_vselect(unseen, rti_vset(0), hi[0]));
        rti_vstore(out[3], hi[1]);
        depth = rti_vmax(depth, rti_vset(0));
        rti_vstore(out[4], rti_vselect(good, rti_vmul(depth, rti_vset((float)(0.999998 / (1 + lens->stretch)))), rti_vset(-1)));
        for (i = 0; i < n; i++) {
            rti_span *span = &r->spans[at + (size_t)i];
            span->lo[0] = out[0][i];
            span->lo[1] = out[1][i];
            span->hi[0] = out[2][i];
            span->hi[1] = out[3][i];
            span->depth = out[4][i];
        }
    }
}

/* Linear functions of a packet's place in its block: at + right * column + down * row, for RTI_WIDTH triangles. */
typedef struct { float at[RTI_WIDTH], right[RTI_WIDTH], down[RTI_WIDTH]; } rti_slopes;

/* Which packets of a block may be hit by a triangle, by its edges and its plane: where the first three functions are not negative, and the
   fourth, the greatest 1 / t there may be up to 1e30, not below 1 / t of what is known. With h the projected vertices, a ray that meets the
   triangle at t has t (x, y, 1) = sum of l_k h_k, so l_k / t = (h_i x h_j) . (x, y, 1) / det is not negative, and 1 / t is the sum of the
   three: linear in x and y, and true of vertices behind the eye too (Olano and Greer 1997). Each is taken where it is greatest in the
   packet and raised by what the errors of h can make of it. Those, see rti_make_lens, are so much larger than what floats lose here that
   they cover that as well. */
RTI_FN void rti_slopes_of(const rti_lens *lens, const rti_block *b, float corners[9][RTI_WIDTH], rti_slopes slopes[4])
{
    const float drift = 1.9073486328125e-06f, limit = (float)RTI_SIDE;
    const rti_v zero = rti_vset(0), one = rti_vset(1), two = rti_vset(2), x = rti_vset(b->x), y = rti_vset(b->y);
    rti_v p[3][3], h[3][3], error[3], n[3][3], loose[3][3], det = zero, slack = zero, sum[3], reach, most, sign;
    unsigned usable;
    int i, k;
    sum[0] = sum[1] = sum[2] = zero;
    reach = rti_vdiv(one, rti_vadd(rti_triangles_from_eye(lens, corners, p), rti_vset((float)lens->tiny)));
    error[0] = rti_vset(((float)lens->sums[0] + b->x * (float)lens->sums[2]) * drift);
    error[1] = rti_vset(((float)lens->sums[1] + b->y * (float)lens->sums[2]) * drift);
    error[2] = rti_vset((float)lens->sums[2] * drift);
    for (i = 0; i < 3; i++) {               /* within 1 of the eye, and as seen from the block's first sample */
        for (k = 0; k < 3; k++) p[i][k] = rti_vmul(p[i][k], reach);
        h[i][2] = rti_wide_row(lens, 2, p[i]);
        h[i][0] = rti_vsub(rti_wide_row(lens, 0, p[i]), rti_vmul(x, h[i][2]));
        h[i][1] = rti_vsub(rti_wide_row(lens, 1, p[i]), rti_vmul(y, h[i][2]));
    }
    for (i = 0; i < 3; i++) {
        const rti_v *h1 = h[(i + 1) % 3], *h2 = h[(i + 2) % 3];
        for (k = 0; k < 3; k++) {
            const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            n[i][k] = rti_vsub(rti_vmul(h1[k1], h2[k2]), rti_vmul(h1[k2], h2[k1]));
            loose[i][k] = rti_vadd(
                rti_vmul(error[k2], rti_vadd(rti_vadd(rti_vabs(h1[k1]), rti_vabs(h2[k1])), rti_vmul(two, error[k1]))),
                rti_vmul(error[k1], rti_vadd(rti_vabs(h1[k2]), rti_vabs(h2[k2]))));
        }
    }
    for (k = 0; k < 3; k++) {
        det = rti_vadd(det, rti_vmul(h[0][k], n[0][k]));
        slack = rti_vadd(slack, rti_vadd(rti_vmul(rti_vabs(h[0][k]), loose[0][k]),
                                         rti_vmul(error[k], rti_vadd(rti_vabs(n[0][k]), loose[0][k]))));
    }
    usable = rti_vlt(rti_vmul(two, slack), rti_vabs(det));              /* else seen edge-on, as far as rounding can tell */
    sign = rti_vsign(one, det);
    for (i = 0; i < 3; i++) {
        const rti_v right = rti_vmul(sign, n[i][0]), down = rti_vmul(sign, n[i][1]);
        rti_v at = rti_vmul(sign, n[i][2]), scale;
        unsigned ok;
        at = rti_vadd(at, rti_vmul(rti_vmax(right, zero), rti_vset((float)(RTI_COLUMNS - 1))));
        at = rti_vadd(at, rti_vmul(rti_vmax(down, zero), rti_vset((float)(RTI_ROWS - 1))));
        at = rti_vadd(at, rti_vmul(rti_vadd(rti_vabs(right), loose[i][0]), rti_vset((float)lens->sway[0])));
        at = rti_vadd(at, rti_vmul(rti_vadd(rti_vabs(down), loose[i][1]), rti_vset((float)lens->sway[1])));
        at = rti_vadd(at, rti_vadd(rti_vmul(rti_vadd(loose[i][0], loose[i][1]), rti_vset(limit)), loose[i][2]));
        scale = rti_vadd(rti_vabs(at), rti_vmul(rti_vadd(rti_vabs(right), rti_vabs(down)), rti_vset(limit)));
        sum[0] = rti_vadd(sum[0], at);
        sum[1] = rti_vadd(sum[1], right);
        sum[2] = rti_vadd(sum[2], down);
        ok = usable & rti_vlt(rti_vset(1e-30f), scale) & rti_vlt(scale, rti_vset(1e30f));
        at = rti_vadd(at, rti_vmul(scale, rti_vset(1e-6f)));            /* what its evaluation may lose */
        rti_vstore(slopes[i].at, rti_vselect(ok, at, one));
        rti_vstore(slopes[i].right, rti_vselect(ok, rti_vmul(right, rti_vset((float)RTI_COLUMNS)), zero));
        rti_vstore(slopes[i].down, rti_vselect(ok, rti_vmul(down, rti_vset((float)RTI_ROWS)), zero));
    }
    most = rti_vdiv(rti_vmul(rti_vset((float)(1 + lens->stretch)), reach), rti_vsub(rti_vabs(det), slack));
    for (k = 0; k < 3; k++) sum[k] = rti_vmul(sum[k], most);
    most = rti_vadd(rti_vabs(sum[0]), rti_vmul(rti_vadd(rti_vabs(sum[1]), rti_vabs(sum[2])), rti_vset(limit)));
    usable &= rti_vlt(most, rti_vset(1e30f));
    sum[0] = rti_vadd(rti_vadd(sum[0], rti_vmul(most, rti_vset(2e-6f))), rti_vset(1e-36f));
    rti_vstore(slopes[3].at, rti_vselect(usable, sum[0], rti_vset(1e36f)));
    rti_vstore(slopes[3].right, rti_vselect(usable, rti_vmul(sum[1], rti_vset((float)RTI_COLUMNS)), zero));
    rti_vstore(slopes[3].down, rti_vselect(usable, rti_vmul(sum[2], rti_vset((float)RTI_ROWS)), zero));
}

/* A block while it is covered. */
typedef struct {
    rti_packet packets[RTI_PACKET_COUNT];   /* row by row */
    unsigned live[RTI_PACKET_COUNT], found[RTI_PACKET_COUNT];
    float last[RTI_PACKET_COUNT];           /* the greatest t that still counts; -infinity where no ray is live */
    float column[RTI_PACKET_COUNT], row[RTI_PACKET_COUNT];
    struct { uint32_t prim; float depth; unsigned char columns[2], rows[2]; } queue[RTI_QUEUE];
    int queued;
    float farthest;                         /* of all last, or more */
} rti_canvas;

/* Lanes that hold no ray have -infinity. */
RTI_FN float rti_last_t(const rti_packet *p)
{
    float last = p->t[0];
    int i;
    for (i = 1; i < RTI_WIDTH; i++) last = p->t[i] > last ? p->t[i] : last;
    return last;
}

/* The packets of entry q that may find it nearer than what they have, by their places in chosen; how many. slopes NULL: all in its span. */
RTI_FN int rti_choose_packets(const rti_canvas *c, int q, const rti_slopes *slopes, int lane, unsigned char *chosen)
{
    const rti_v left = rti_vset((float)c->queue[q].columns[0]), right = rti_vset((float)c->queue[q].columns[1]);
    const rti_v upper = rti_vset((float)c->queue[q].rows[0]), lower = rti_vset((float)c->queue[q].rows[1]);
    const int end = (c->queue[q].rows[1] + 1) * RTI_ACROSS;
    int first = c->queue[q].rows[0] * RTI_ACROSS / RTI_WIDTH * RTI_WIDTH, count = 0, i;
    for (; first < end; first += RTI_WIDTH) {
        const rti_v last = rti_vload(c->last + first), x = rti_vload(c->column + first), y = rti_vload(c->row + first);
        unsigned lanes = rti_vle(rti_vset(c->queue[q].depth), last) & rti_vle(left, x) & rti_vle(x, right) & rti_vle(upper, y) &
            rti_vle(y, lower);
        for (i = 0; i < 4 && slopes && lanes; i++) {
            rti_v value = rti_vadd(rti_vmul(rti_vset(slopes[i].right[lane]), x), rti_vmul(rti_vset(slopes[i].down[lane]), y));
            value = rti_vadd(rti_vset(slopes[i].at[lane]), value);
            lanes &= i < 3 ? rti_vle(rti_vset(0), value) : rti_vle(rti_vset(1), rti_vmul(value, rti_vmax(last, rti_vset(1e-30f))));
        }
        for (; lanes; lanes &= lanes - 1) chosen[count++] = (unsigned char)(first + rti_lowest_bit(lanes));
    }
    return count;
}

RTI_FN void rti_note_hits(rti_canvas *c, int packet, unsigned hit)
{
    if (!hit) return;
    c->found[packet] |= hit;
    c->last[packet] = rti_last_t(&c->packets[packet]);
}

/* Tests what is queued, about nearest first. Triangles wait until RTI_WIDTH are together. */
RTI_NOINLINE RTI_TARGET void rti_cover_queue(const rt_raster *r, const rti_block *b, rti_canvas *c)
{
    const rt_geometry *geo = &r->accel.geo;
    const size_t triangles = geo->triangle_count, balls = triangles + rti_sphere_count(geo);
    unsigned char order[RTI_QUEUE + 1], chosen[RTI_PACKET_COUNT], waiting[RTI_WIDTH];
    float corners[9][RTI_WIDTH];
    rti_slopes slopes[4];
    rti_triangle triangle;
#if RTI_SPHERES
    rti_ball ball;
#endif
    rt_accel one;                           /* holds the primitive at hand */
    int n, i, k, count, together = 0;
    memset(&one, 0, sizeof one);
    memset(corners, 0, sizeof corners);
    memset(waiting, 0, sizeof waiting);
    one.triangles = &triangle;
    (void)balls;
    for (n = 0; n < c->queued; n++) {
        for (i = n; i > 0 && c->queue[order[i - 1]].depth > c->queue[n].depth; i--) order[i] = order[i - 1];
        order[i] = (unsigned char)n;
    }
    for (n = 0; n < c->queued; n++) {
        const int q = order[n];
        const uint32_t prim = c->queue[q].prim;
        count = rti_choose_packets(c, q, NULL, 0, chosen);
        if (prim < triangles && count) {
            (void)rti_fetch_triangle(geo, prim, triangle.v);
            if (count > RTI_FEW && r->lens.narrow) {
                for (k = 0; k < 9; k++) corners[k][together] = triangle.v[k];
                waiting[together++] = (unsigned char)q;
            } else {
                triangle.prim = prim;
                for (i = 0; i < count; i++) {
                    k = chosen[i];
                    rti_note_hits(c, k, rti_hit_triangles(&one, &c->packets[k], c->live[k], NULL, 0, 1, RT_NONE, 0));
                }
            }
        }
#if RTI_SPHERES
        else if (prim < balls && count) {
            one.balls = &ball;
            ball.prim = prim;
            rti_fill_ball(&ball, geo);
            for (i = 0; i < count; i++)
                rti_note_hits(c, chosen[i], rti_hit_spheres(&one, &c->packets[chosen[i]], c->live[chosen[i]], NULL, 0, 1, RT_NONE, 0));
        }
#endif
#if RTI_INSTANCES
        else if (count) {
            const uint32_t number = (uint32_t)(prim - balls);
            for (i = 0; i < count; i++) {
                k = chosen[i];
                rti_note_hits(c, k, rti_hit_instances(&r->accel, &c->packets[k], c->live[k], NULL, number, 1, RT_NONE, &rti_plain_jobs[RT_CLOSEST]));
            }
        }
#endif
        if (!together || (together < RTI_WIDTH && n + 1 < c->queued)) continue;
        rti_slopes_of(&r->lens, b, corners, slopes);
        for (i = 0; i < together; i++) {
            count = rti_choose_packets(c, waiting[i], slopes, i, chosen);
            triangle.prim = c->queue[waiting[i]].prim;
            for (k = 0; k < 9; k++) triangle.v[k] = corners[k][i];
            for (k = 0; k < count; k++)
                rti_note_hits(c, chosen[k], rti_hit_triangles(&one, &c->packets[chosen[k]], c->live[chosen[k]], NULL, 0, 1, RT_NONE, 0));
        }
        together = 0;
    }
    c->queued = 0;
    c->farthest = c->last[0];
    for (k = 1; k < RTI_PACKET_COUNT; k++) c->farthest = c->last[k] > c->farthest ? c->last[k] : c->farthest;
}

/* A block of pixels: the packets test what the block's tiles list, where its span meets them and may be nearer than what they have. */
RTI_NOINLINE RTI_TARGET void rti_cover(const rt_raster *r, const rti_block *b)
{
    const float right = (float)(b->box[2] - b->box[0] - 1), down = (float)(b->box[3] - b->box[1] - 1);
    rti_canvas c;
    int k, i, level;
    c.queued = 0;
    c.farthest = RTI_INFINITY;
    for (k = 0; k < RTI_PACKET_COUNT; k++) {
        unsigned lanes = 0;
        for (i = 0; i < RTI_WIDTH; i++)
            if (b->box[0] + k % RTI_ACROSS * RTI_COLUMNS + i % RTI_COLUMNS < b->box[2] &&
                b->box[1] + k / RTI_ACROSS * RTI_ROWS + i / RTI_COLUMNS < b->box[3]) lanes |= 1u << i;
        c.column[k] = (float)(k % RTI_ACROSS);
        c.row[k] = (float)(k / RTI_ACROSS);
        c.last[k] = -RTI_INFINITY;
        c.live[k] = c.found[k] = 0;
        if (!lanes) continue;
        rti_load_rays(b->rays + k * RTI_WIDTH, &c.packets[k]);
        rti_no_hits(&c.packets[k]);
        c.live[k] = rti_prepare(&r->accel, &c.packets[k], lanes, false);
#if RTI_INSTANCES
        if (r->accel.moves) memset(c.packets[k].time, 0, sizeof c.packets[k].time);
#endif
#if RTI_PLANES
        if (r->accel.plane_count) c.found[k] = rti_hit_planes(&r->accel, &c.packets[k], c.live[k], RT_NONE, &rti_plain_jobs[RT_CLOSEST]);
#endif
        for (i = 0; i < RTI_WIDTH; i++)
            if (!(c.live[k] >> i & 1)) c.packets[k].t[i] = -RTI_INFINITY;
        c.last[k] = rti_last_t(&c.packets[k]);
    }
    for (level = 0; level < r->level_count; level++) {
        const rti_level *tiles = &r->levels[level];
        const int column = b->box[0] >> tiles->shift, row = b->box[1] >> tiles->shift;
        const size_t tile = tiles->first + (size_t)row * (size_t)tiles->columns + (size_t)column;
        uint32_t at = r->starts[tile], end = r->starts[tile + 1];
        for (; at < end; at++) {
            const rti_span *span = &r->spans[r->entries[at]];
            const float x0 = span->lo[0] - b->x, x1 = span->hi[0] - b->x, y0 = span->lo[1] - b->y, y1 = span->hi[1] - b->y;
            int first_x, first_y, last_x, last_y;
            if (x0 > right || y0 > down || x1 < 0 || y1 < 0 || span->depth > c.farthest) continue;
            first_x = x0 > 0 ? (int)x0 : 0;
            first_y = y0 > 0 ? (int)y0 : 0;
            first_x += (float)first_x < x0;
            first_y += (float)first_y < y0;
            last_x = (int)(x1 < right ? x1 : right);
            last_y = (int)(y1 < down ? y1 : down);
            if (first_x > last_x || first_y > last_y) continue;         /* between samples */
            c.queue[c.queued].prim = r->entries[at];
            c.queue[c.queued].depth = span->depth;
            c.queue[c.queued].columns[0] = (unsigned char)(first_x / RTI_COLUMNS);
            c.queue[c.queued].columns[1] = (unsigned char)(last_x / RTI_COLUMNS);
            c.queue[c.queued].rows[0] = (unsigned char)(first_y / RTI_ROWS);
            c.queue[c.queued].rows[1] = (unsigned char)(last_y / RTI_ROWS);
            if (++c.queued == RTI_QUEUE) rti_cover_queue(r, b, &c);
        }
    }
    rti_cover_queue(r, b, &c);
    for (k = 0; k < RTI_PACKET_COUNT; k++)
        for (i = 0; i < RTI_WIDTH; i++) {
            const int x = k % RTI_ACROSS * RTI_COLUMNS + i % RTI_COLUMNS, y = k / RTI_ACROSS * RTI_ROWS + i / RTI_COLUMNS;
            rt_hit *hit = &b->hits[(size_t)y * b->stride + (size_t)x];
            if (x > b->box[2] - b->box[0] - 1 || y > b->box[3] - b->box[1] - 1) continue;
            if (!(c.found[k] >> i & 1)) rti_set_miss(hit);
            else {
                hit->t = c.packets[k].t[i];
                hit->u = c.packets[k].u[i];
                hit->v = c.packets[k].v[i];
                hit->prim = c.packets[k].prim.id[i];
                hit->inst = c.packets[k].inst.id[i];
            }
        }
}

#undef RTI_COLUMNS
#undef RTI_ROWS
#undef RTI_SIDE
#undef RTI_ACROSS
#undef RTI_PACKET_COUNT
#undef RTI_QUEUE
#undef RTI_FEW

#endif

/* ---- >>shade -------------------------------------------------------------------------------------------------------- */

#ifndef RT_NO_SHADING

/* Products are rounded before they are summed, so that every width draws the same picture. */

#define rti_vsqrt RTI_NAME_(rti_vsqrt)
#define rti_vdot RTI_NAME_(rti_vdot)
#define rti_vlargest RTI_NAME_(rti_vlargest)
#define rti_vunit RTI_NAME_(rti_vunit)
#define rti_vflip RTI_NAME_(rti_vflip)
#define rti_vload3 RTI_NAME_(rti_vload3)
#define rti_vstore3 RTI_NAME_(rti_vstore3)
#define rti_finish_lanes RTI_NAME_(rti_finish_lanes)
#define rti_aim_lanes RTI_NAME_(rti_aim_lanes)
#define rti_finish RTI_NAME_(rti_finish)
#define rti_aim RTI_NAME_(rti_aim)

#if RTI_LANES == RTI_LANES_FLOAT
RTI_FN rti_v rti_vsqrt(rti_v a) { return sqrtf(a); }
#elif RTI_LANES == RTI_LANES_ARRAY
RTI_FN rti_v rti_vsqrt(rti_v a) { int i; for (i = 0; i < RTI_WIDTH; i++) a.f[i] = sqrtf(a.f[i]); return a; }
#elif RTI_LANES == RTI_LANES_SSE2
RTI_FN rti_v rti_vsqrt(rti_v a) { return _mm_sqrt_ps(a); }
#else
RTI_FN rti_v rti_vsqrt(rti_v a) { return _mm256_sqrt_ps(a); }
#endif

#endif
#endif
#if RTI_IN(SHADE) && !defined(RT_NO_SHADING)
RTI_SHARED(
RTI_FN rti_v rti_vdot(const rti_v a[3], const rti_v b[3])
{
    return rti_vadd(rti_vadd(rti_vround(rti_vmul(a[0], b[0])), rti_vround(rti_vmul(a[1], b[1]))), rti_vround(rti_vmul(a[2], b[2])));
}

RTI_FN rti_v rti_vlargest(const rti_v a[3]) { return rti_vmax(rti_vmax(rti_vabs(a[0]), rti_vabs(a[1])), rti_vabs(a[2])); }
)

/* As rti_normalize. */
RTI_SHARED(
RTI_FN void rti_vunit(rti_v a[3])
{
    const rti_v least = rti_vset(FLT_MIN), one = rti_vset(1);
    rti_v scale = rti_vdiv(one, rti_vmax(rti_vlargest(a), least));
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) a[k] = rti_vmul(a[k], scale);
    scale = rti_vdiv(one, rti_vsqrt(rti_vmax(rti_vdot(a, a), least)));
    RTI_UNROLL
    for (k = 0; k < 3; k++) a[k] = rti_vmul(a[k], scale);
}
)

/* Turns a round where sign is negative. */
RTI_SHARED(
RTI_FN void rti_vflip(rti_v a[3], rti_v sign)
{
    const rti_v side = rti_vsign(rti_vset(1), sign);
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) a[k] = rti_vmul(a[k], side);
}

RTI_FN void rti_vload3(const float *lanes, int lane, rti_v a[3])
{
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) a[k] = rti_vload(lanes + (lane + k) * RTI_ABREAST);
}

RTI_FN void rti_vstore3(float *lanes, int lane, const rti_v a[3])
{
    int k;
    RTI_UNROLL
    for (k = 0; k < 3; k++) rti_vstore(lanes + (lane + k) * RTI_ABREAST, a[k]);
}
)

/* From what is gathered to what rti_lane says of each surface. */
RTI_SHARED(
RTI_FN void rti_finish_lanes(float *lanes)
{
    rti_v point[3], view[3], geometric[3], normal[3], offset;
    int k;
    rti_vload3(lanes, RTI_POINT, point);
    rti_vload3(lanes, RTI_VIEW, view);
    rti_vload3(lanes, RTI_GEOMETRIC, geometric);
    rti_vload3(lanes, RTI_NORMAL, normal);
    offset = rti_vmul(rti_vload(lanes + RTI_OFFSET * RTI_ABREAST), rti_vset(3e-6f));     /* some 50 rounding errors */
    RTI_UNROLL
    for (k = 0; k < 3; k++) view[k] = rti_vsub(rti_vset(0), view[k]);
    rti_vunit(view);
    rti_vunit(geometric);
    rti_vunit(normal);
    rti_vflip(geometric, rti_vdot(geometric, view));
    rti_vflip(normal, rti_vdot(normal, geometric));
    RTI_UNROLL
    for (k = 0; k < 3; k++) point[k] = rti_vadd(point[k], rti_vround(rti_vmul(geometric[k], offset)));
    rti_vstore3(lanes, RTI_POINT, point);
    rti_vstore3(lanes, RTI_VIEW, view);
    rti_vstore3(lanes, RTI_GEOMETRIC, geometric);
    rti_vstore3(lanes, RTI_NORMAL, normal);
    rti_vstore(lanes + RTI_OFFSET * RTI_ABREAST, offset);
}
)

/* What one light, there, does to each surface that it may reach. */
RTI_SHARED(
RTI_FN void rti_aim_lanes(float *lanes, const rti_v there[3])
{
    const rti_v zero = rti_vset(0);
    rti_v point[3], view[3], geometric[3], normal[3], to[3], cosine, mirrored;
    unsigned before;
    int k;
    rti_vload3(lanes, RTI_POINT, point);
    rti_vload3(lanes, RTI_VIEW, view);
    rti_vload3(lanes, RTI_GEOMETRIC, geometric);
    rti_vload3(lanes, RTI_NORMAL, normal);
    RTI_UNROLL
    for (k = 0; k < 3; k++) to[k] = rti_vsub(there[k], point[k]);
    rti_vstore3(lanes, RTI_TO_LIGHT, to);
    rti_vunit(to);
    cosine = rti_vdot(normal, to);
    before = rti_vlt(zero, rti_vdot(geometric, to));
    mirrored = rti_vmul(rti_vadd(cosine, cosine), rti_vdot(normal, view));
    rti_vstore(lanes + RTI_COSINE * RTI_ABREAST, rti_vselect(before, cosine, zero));
    rti_vstore(lanes + RTI_HIGHLIGHT * RTI_ABREAST, rti_vsub(rti_vround(mirrored), rti_vdot(to, view)));
}
)
#endif
#if RTI_IN(HOST)

#ifndef RT_NO_SHADING
RTI_NOINLINE RTI_TARGET void rti_finish(rti_surfaces *s, size_t count)
{
    size_t at;
    for (at = 0; at < count; at += RTI_WIDTH) rti_finish_lanes(s[at / RTI_ABREAST].lanes + at % RTI_ABREAST);
}

RTI_NOINLINE RTI_TARGET void rti_aim(rti_surfaces *s, size_t count, const rt_vec3 *light)
{
    const rti_v zero = rti_vset(0);
    rti_v there[3] = { zero, zero, zero };
    size_t at;
    if (light) {
        there[0] = rti_vset(light->x);
        there[1] = rti_vset(light->y);
        there[2] = rti_vset(light->z);
    }
    for (at = 0; at < count; at += RTI_WIDTH) {
        float *const lanes = s[at / RTI_ABREAST].lanes + at % RTI_ABREAST;
        if (!light) rti_vload3(lanes, RTI_TO_LIGHT, there);
        rti_aim_lanes(lanes, there);
    }
}

#undef rti_vsqrt
#undef rti_vdot
#undef rti_vlargest
#undef rti_vunit
#undef rti_vflip
#undef rti_vload3
#undef rti_vstore3
#undef rti_finish_lanes
#undef rti_aim_lanes
#undef rti_finish
#undef rti_aim

#endif

#endif

#undef RTI_NAME_
#undef rti_v
#undef rti_d
#undef rti_vset
#undef rti_vid
#undef rti_vload
#undef rti_vstore
#undef rti_vadd
#undef rti_vsub
#undef rti_vmul
#undef rti_vdiv
#undef rti_vmin
#undef rti_vmax
#undef rti_vabs
#undef rti_vsign
#undef rti_vlt
#undef rti_vle
#undef rti_vnegative
#undef rti_vselect
#undef rti_vround
#undef rti_vorigin
#undef rti_vplane
#undef rti_dset
#undef rti_dload
#undef rti_dstore
#undef rti_dadd
#undef rti_dsub
#undef rti_dmul
#undef rti_ddiv
#undef rti_dsqrt
#undef rti_dmin
#undef rti_dmax
#undef rti_dlt
#undef rti_dselect
#undef rti_widen
#undef rti_narrow
#undef rti_packet
#undef rti_load_rays
#undef rti_orient
#undef rti_least
#undef rti_pad
#undef rti_invert_dir
#undef rti_prepare
#undef rti_slab
#undef rti_make_slab
#undef rti_cross_slab
#undef rti_hit_box
#undef rti_slabs
#undef rti_make_slabs
#undef rti_accept
#undef rti_edge
#undef rti_edge_exact
#undef rti_product
#undef rti_dot_exact
#undef rti_shear
#undef rti_make_shear
#undef rti_decide
#undef rti_hit_triangle
#undef rti_hit_triangles
#undef rti_hit_spheres
#undef rti_enter_instance
#undef rti_leave_instance
#undef rti_hit_instances
#undef rti_hit_leaf
#undef rti_walk_body
#undef rti_accept_lanes
#undef rti_walk_wide
#undef rti_probe
#undef rti_make_probe
#undef rti_wide_from
#undef rti_interval
#undef rti_bound_lanes
#undef rti_make_interval
#undef rti_cross_interval
#undef rti_meet_lanes
#undef rti_sheaf_octet
#undef rti_sheaf_body
#undef rti_sheaf_closest
#undef rti_sheaf_any
#undef rti_crowd
#undef rti_make_crowd
#undef rti_crowd_part
#undef rti_wide_boxes
#undef rti_wide_box
#undef rti_octet_boxes
#undef rti_crowd_meets
#undef rti_crowd_note
#undef rti_crowd_octet
#undef rti_crowd_others
#undef rti_crowd_body
#undef rti_crowd_closest
#undef rti_crowd_any
#undef rti_crowd_closest_count
#undef rti_crowd_any_count
#undef rti_walk_crowd
#undef rti_count_list
#undef rti_batch_crowds
#undef rti_crowd_packets
#undef rti_probe_children
#undef rti_hit_octet
#undef rti_gather_octet
#undef rti_wide_body
#undef rti_wide_closest
#undef rti_wide_any
#undef rti_wide_closest_all
#undef rti_wide_any_all
#undef rti_wide_closest_count
#undef rti_wide_any_count
#undef rti_walk
#undef rti_walk_child
#undef rti_walk_closest
#undef rti_walk_any
#undef rti_walk_closest_all
#undef rti_walk_any_all
#undef rti_walk_closest_count
#undef rti_walk_any_count
#undef rti_kdstate
#undef rti_kdray
#undef rti_kdring
#undef rti_kd_push
#undef rti_kd_cross
#undef rti_hit_run
#undef rti_hit_others
#undef rti_large_others
#undef rti_kd_hit_leaf
#undef rti_kd_stack_body
#undef rti_kd_restart_body
#undef rti_kd_begin
#undef rti_kd_enter
#undef rti_kd_stack_closest
#undef rti_kd_stack_any
#undef rti_kd_stack_closest_count
#undef rti_kd_stack_any_count
#undef rti_kd_restart_closest
#undef rti_kd_restart_any
#undef rti_kd_restart_any_all
#undef rti_kd_restart_closest_all
#undef rti_kd_restart_closest_count
#undef rti_kd_restart_any_count
#undef rti_kd_stack_closest_all
#undef rti_kd_stack_any_all
#undef rti_kd_walker
#undef rti_tree_walker
#undef rti_walker
#undef rti_walker_of
#undef rti_single_walk
#undef rti_wide_root_closest
#undef rti_wide_root_any
#undef rti_walk_nothing
#undef rti_walk_planes
#undef rti_hit_planes
#undef rti_sweep
#undef rti_make_sweep
#undef rti_meet_sphere
#undef rti_thread_state
#undef rti_thread_start
#undef rti_thread_enter
#undef rti_thread_leave
#undef rti_thread_body
#undef rti_thread_closest
#undef rti_thread_any
#undef rti_thread_closest_all
#undef rti_thread_any_all
#undef rti_thread_closest_count
#undef rti_thread_any_count
#undef rti_thread_closest_round
#undef rti_thread_any_round
#undef rti_thread_aim
#undef rti_thread_walker
#undef rti_thread_groups
#undef rti_batch_parallel
#undef RTI_GROUPS
#undef rti_vfma
#undef rti_vquad
#undef rti_vapart
#undef rti_lowest_of
#undef rti_vleast
#undef rti_vleasts
#undef rti_crowd_least
#undef rti_crowd_most
#undef rti_vmost
#undef rti_large
#undef rti_door
#undef rti_make_door
#undef rti_pass
#undef rti_lane_range
#undef rti_range
#undef rti_no_range
#undef rti_range_add
#undef rti_prepare_shared
#undef rti_survey_slopes
#undef rti_bound_general
#undef rti_make_frustum
#undef rti_cull_box
#undef rti_facets
#undef rti_edges
#undef rti_between_planes
#undef rti_hit_facets
#undef rti_facets_closest
#undef rti_facets_any
#undef rti_facets_closest_likely
#undef rti_facets_any_likely
#undef rti_note
#undef rti_count_rays
#undef rti_large_triangles
#undef rti_large_instances
#undef rti_large_leaf
#undef rti_ask
#undef rti_beside
#undef rti_first_hit
#undef rti_last_hit
#undef rti_part_rays
#undef rti_mask_rays
#undef rti_large_body
#undef rti_walk_masked
#undef rti_walk_ranged
#undef rti_walk_partition
#undef rti_walk_masked_count
#undef rti_walk_ranged_count
#undef rti_walk_partition_count
#undef rti_close_lanes
#undef rti_large_walk
#undef rti_take_rays
#undef rti_give_hits
#undef rti_fetch
#undef rti_batch_packets
#undef rti_no_hits
#undef rti_take_lanes
#undef rti_give_lanes
#undef rti_batch_run
#undef rti_batch_auto
#undef rti_batch_large
#undef rti_batch_largest
#undef rti_batch
#undef rti_triangles_from_eye
#undef rti_wide_row
#undef rti_see_triangles
#undef rti_slopes
#undef rti_slopes_of
#undef rti_canvas
#undef rti_last_t
#undef rti_choose_packets
#undef rti_note_hits
#undef rti_cover_queue
#undef rti_cover
#undef RTI_SIMD_RAYS
#undef RTI_NESTED
#undef RTI_FN
#undef RTI_ALL_LANES
#undef RTI_WIDTH
#undef RTI_LANES
#undef RTI_SUFFIX
#undef RTI_FMA
#undef RTI_TARGET

#endif /* RTI_PASS */

/* ---- >>license ------------------------------------------------------------------------------------------------------

   This software is available under two licenses: choose whichever you prefer.

   ALTERNATIVE A - MIT License. Copyright (c) 2026 the rt.h authors

   Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation files
   (the "Software"), to deal in the Software without restriction, including without limitation the rights to use, copy, modify, merge,
   publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is furnished to do so,
   subject to the following conditions: The above copyright notice and this permission notice shall be included in all copies or
   substantial portions of the Software.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF
   MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE
   FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
   CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.

   ALTERNATIVE B - Public Domain (www.unlicense.org)

   This is free and unencumbered software released into the public domain. Anyone is free to copy, modify, publish, use, compile, sell,
   or distribute this software, either in source code form or as a compiled binary, for any purpose, commercial or non-commercial, and
   by any means. In jurisdictions that recognize copyright laws, the author or authors of this software dedicate any and all copyright
   interest in the software to the public domain. We make this dedication for the benefit of the public at large and to the detriment of
   our heirs and successors. We intend this dedication to be an overt act of relinquishment in perpetuity of all present and future
   rights to this software under copyright law.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF
   MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS BE LIABLE FOR ANY CLAIM, DAMAGES
   OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR
   THE USE OR OTHER DEALINGS IN THE SOFTWARE.  */
