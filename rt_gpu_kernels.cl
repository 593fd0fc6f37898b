/* rt_gpu_kernels.cl - what rt_gpu.h runs on devices, in OpenCL C 1.2.    SPDX-License-Identifier: MIT OR Unlicense

   rt_gpu.h includes this file a part at a time, RTI_SHARED making strings of what stands in it, as it includes rt.h for the traversals,
   primitive tests, sampling and shading that both have in common: so programs carry their kernels, and need no file. A program is put
   together for one scene, and for one algorithm, or for the steps of pictures (rti_gpu_write_program in rt_gpu.h): definitions first, then
   parts, in the order of their numbers there.

   Instances are entered without recursion, which devices lack: all from INSTANCES to WALK stands in the program once a level of nesting,
   the innermost first, every name with the level's number (RTI_LEVEL_NAMES in rt_gpu.h). What no accel of a level has is left out.  */

/* ---- layout: the same as C and on the device ------------------------------------------------------------------------ */

#if RTI_IN(LAYOUT)

/* An accel as it is uploaded; arrays are given in units of RTI_GPU_ALIGN bytes from where all accels start. */
RTI_SHARED(
typedef struct {
    uint32_t structure, node_count, plane_count, moves, bounds, orders, order_axes[3], slots[3];
    uint32_t nodes, kdnodes, kdlinks, kdslots, links, triangles, balls, planes, instances, wide;
    uint32_t instance_bases, instance_slots, instance_count, paths;     /* see rti_family of rt.h */
    float lower[3], upper[3], extent, spread;
} rti_gpu_record;
typedef char rti_check_record[sizeof(rti_gpu_record) == 136 ? 1 : -1];
)
#if RTI_INSTANCES
RTI_SHARED(
typedef struct {
    float transform[12], inverse[12];
    uint32_t accel, prim, base, moves;
    rt_motion motion;
} rti_gpu_instance;
typedef char rti_check_instance[sizeof(rti_gpu_instance) == 152 ? 1 : -1];
)
#endif

/* rti_wide for GPUs, half of it, and for a device without octets, its leaves those of the binary tree: planes in steps of 2^exponent from an origin, rounded outwards. */
RTI_SHARED(
typedef struct { float origin[3]; signed char exponent[4]; uint8_t bounds[6][8]; uint32_t index[8], count[8]; } rti_gpu_compact;
typedef char rti_check_compact[sizeof(rti_gpu_compact) == 128 ? 1 : -1];
)

#endif

/* ---- device: C's types and functions, and an accel in reach of one work-item ---------------------------------------- */

#if RTI_IN(TYPES)

"#pragma OPENCL FP_CONTRACT OFF\n"
"#ifdef cl_khr_fp64\n"
"#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n"
"#endif\n"
"#ifdef __clang__\n"
"#define RTI_FN static inline __attribute__((always_inline))\n"
"#define RTI_UNROLL _Pragma(\"unroll\")\n"
"#else\n"
"#define RTI_FN static inline\n"
"#define RTI_UNROLL\n"
"#endif\n"
"#if defined(FP_FAST_FMAF) || defined(__FMA__) || RTI_GPU\n"
"#define RTI_FMA 1\n"
"#else\n"
"#define RTI_FMA 0\n"
"#endif\n"
"#define RTI_INLINE RTI_FN\n"
"#define RTI_GROUP __attribute__((reqd_work_group_size(64, 1, 1)))\n"
"#define RTI_TARGET\n"
"#define RTI_GLOBAL __global\n"
"#define RTI_UNLIKELY(x) (x)\n"
"#define RTI_ALIGNED(n)\n"
"#define RTI_TALLY(stats, flags, field, n) ((void)0)\n"
"#define RTI_COUNTS(job) false\n"
"#define RTI_KD_TALLY(at) ((void)0)\n"
"#define RT_ASSERT(x) ((void)0)\n"
"#define RTI_INFINITY INFINITY\n"
"#define fabsf fabs\n"
"#define RTI_OPEN(name, parent, number) rt_accel name##_opened; const rt_accel *const name = &name##_opened; "
    "rti_open(&name##_opened, (parent)->arena, number)\n"
"#define rti_instance RTI_INSTANCE_TYPE\n"

RTI_SHARED(
typedef uchar uint8_t;
typedef int int32_t;
typedef long int64_t;
typedef uint uint32_t;
typedef ulong uint64_t;
typedef struct { float x, y, z; } rt_vec3;
typedef struct { rt_vec3 org; float tmin; rt_vec3 dir; float tmax; } rt_ray;
typedef struct { float t, u, v; uint32_t prim, inst; } rt_hit;
typedef struct { rt_vec3 move, pivot, axis; float angle; } rt_motion;
RTI_FN double rti_round(double x) { return x; }
RTI_FN double rti_keep(double x) { return x; }
typedef int rt_query;
typedef int rt_algorithm;
typedef struct { rt_query query; rt_algorithm algorithm; int entries; } rti_job;
)

#endif

#if RTI_IN(DEVICE)

RTI_SHARED(
typedef struct {
    const RTI_GLOBAL char *arena;
    const RTI_GLOBAL rti_gpu_record *record;
    uint32_t structure, node_count, plane_count, moves, bounds, orders, order_axes[3], slots[3];
    float lower[3], upper[3], extent, spread;
    const RTI_GLOBAL rti_node *nodes;
    const RTI_GLOBAL rti_kdnode *kdnodes;
    const RTI_GLOBAL rti_kdlink *kdlinks;
    const RTI_GLOBAL uint32_t *kdslots;
    const RTI_GLOBAL rti_link *links;
    const RTI_GLOBAL rti_triangle *triangles;
    const RTI_GLOBAL rti_ball *balls;
    const RTI_GLOBAL rti_ground *planes;
    const RTI_GLOBAL RTI_INSTANCE_TYPE *instances;
    const RTI_GLOBAL RTI_WIDE_NODE *wide;
} rt_accel;

RTI_FN const RTI_GLOBAL char *rti_reach(const RTI_GLOBAL char *arena, uint32_t at) { return arena + (size_t)at * RTI_GPU_ALIGN; }

RTI_FN void rti_open(rt_accel *a, const RTI_GLOBAL char *arena, uint32_t number)
{
    const RTI_GLOBAL rti_gpu_record *r = (const RTI_GLOBAL rti_gpu_record *)arena + number;
    int k;
    a->arena = arena;
    a->record = r;
    a->structure = r->structure;
    a->node_count = r->node_count;
    a->plane_count = r->plane_count;
    a->moves = r->moves;
    a->bounds = r->bounds;
    a->orders = r->orders;
    for (k = 0; k < 3; k++) {
        a->order_axes[k] = r->order_axes[k];
        a->slots[k] = r->slots[k];
        a->lower[k] = r->lower[k];
        a->upper[k] = r->upper[k];
    }
    a->extent = r->extent;
    a->spread = r->spread;
    a->nodes = (const RTI_GLOBAL rti_node *)rti_reach(arena, r->nodes);
    a->kdnodes = (const RTI_GLOBAL rti_kdnode *)rti_reach(arena, r->kdnodes);
    a->kdlinks = r->kdlinks ? (const RTI_GLOBAL rti_kdlink *)rti_reach(arena, r->kdlinks) : 0;
    a->kdslots = (const RTI_GLOBAL uint32_t *)rti_reach(arena, r->kdslots);
    a->links = (const RTI_GLOBAL rti_link *)rti_reach(arena, r->links);
    a->triangles = (const RTI_GLOBAL rti_triangle *)rti_reach(arena, r->triangles);
    a->balls = (const RTI_GLOBAL rti_ball *)rti_reach(arena, r->balls);
    a->planes = (const RTI_GLOBAL rti_ground *)rti_reach(arena, r->planes);
    a->instances = (const RTI_GLOBAL RTI_INSTANCE_TYPE *)rti_reach(arena, r->instances);
    a->wide = (const RTI_GLOBAL RTI_WIDE_NODE *)rti_reach(arena, r->wide);
}

RTI_FN int rti_highest_bit(uint64_t bits) { return 63 - (int)clz(bits); }
RTI_FN int rti_bit_count(unsigned bits) { return (int)popcount(bits); }

RTI_FN const RTI_GLOBAL float *rti_corners(const rt_accel *accel, uint32_t slot, float *gathered, uint32_t *prim)
{
    (void)gathered;
    *prim = accel->triangles[slot].prim;
    return accel->triangles[slot].v;
}
RTI_FN rti_ball rti_ball_at(const rt_accel *accel, uint32_t slot) { return accel->balls[slot]; }
)

/* Pixel i of a tile: in blocks of 8 x 8, and within those in Morton order, so that rays beside each other are neighbours. */
RTI_SHARED(
RTI_FN uint32_t rti_place_of(uint32_t i, uint32_t width, uint32_t height)
{
    const uint32_t band = i / (8 * width), rest = i - band * 8 * width, rows = min(8u, height - 8 * band), column = rest / (8 * rows);
    const uint32_t at = rest - column * 8 * rows, columns = min(8u, width - 8 * column);
    uint32_t x = at % columns, y = at / columns;
    if (columns == 8 && rows == 8) {
        x = (at & 1) | (at >> 1 & 2) | (at >> 2 & 4);
        y = (at >> 1 & 1) | (at >> 2 & 2) | (at >> 3 & 4);
    }
    return (8 * band + y) * width + 8 * column + x;
}
)

/* Bit i: the sign of element i. */
RTI_SHARED(RTI_FN unsigned rti_signs2(int2 a) { return (uint)a.x >> 31 | (uint)a.y >> 31 << 1; })
"#if defined(__SSE__) && defined(__clang__)\n"
RTI_SHARED(RTI_FN unsigned rti_signs4(int4 a) { return (unsigned)__builtin_ia32_movmskps(as_float4(a)); })
"#else\n"
RTI_SHARED(
RTI_FN unsigned rti_signs4(int4 a)
{
    a = a >> 31 & (int4)(1, 2, 4, 8);
    return (unsigned)(a.x | a.y | a.z | a.w);
}
)
"#endif\n"
"#if defined(__AVX__) && defined(__clang__)\n"
RTI_SHARED(RTI_FN unsigned rti_signs8(int8 a) { return (unsigned)__builtin_ia32_movmskps256(as_float8(a)); })
"#else\n"
RTI_SHARED(RTI_FN unsigned rti_signs8(int8 a) { return rti_signs4(a.lo) | rti_signs4(a.hi) << 4; })
"#endif\n"

#endif

/* ---- lane: RTI_WIDTH is 1, see >>wide of rt.h ----------------------------------------------------------------------- */

#if RTI_IN(LANE)

RTI_SHARED(
typedef float rti_v;
typedef double rti_d;
RTI_FN rti_v rti_vset(float x) { return x; }
RTI_FN rti_v rti_vid(uint32_t id) { return as_float(id); }
RTI_FN rti_v rti_vload(const float *p) { return *p; }
RTI_FN void rti_vstore(float *p, rti_v a) { *p = a; }
RTI_FN rti_v rti_lload(const __local float *p) { return *p; }
RTI_FN void rti_lstore(__local float *p, rti_v a) { *p = a; }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { return a < b; }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { return a <= b; }
RTI_FN unsigned rti_vnegative(rti_v a) { return as_uint(a) >> 31; }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b) { return lanes ? a : b; }
RTI_FN rti_d rti_dset(double x) { return x; }
RTI_FN rti_d rti_dload(const double *p) { return *p; }
RTI_FN void rti_dstore(double *p, rti_d a) { *p = a; }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b) { return a < b; }
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b) { return lanes ? a : b; }
RTI_FN rti_d rti_widen(rti_v a) { return (double)a; }
RTI_FN rti_v rti_narrow(rti_d a) { return (float)a; }
)

#endif

/* ---- lanes: RTI_WIDTH is 2, 4, 8 or 16; RTI_VECTOR(type) is type2 and so on ----------------------------------------- */

#if RTI_IN(LANES)

RTI_SHARED(
typedef RTI_VECTOR(float) rti_v;
typedef RTI_VECTOR(double) rti_d;
)

RTI_SHARED(
RTI_FN unsigned rti_signs16(int16 a) { return rti_signs8(a.lo) | rti_signs8(a.hi) << 8; }
RTI_FN RTI_VECTOR(int) rti_spread_lanes(unsigned lanes)
{
    const RTI_VECTOR(int) bits = RTI_LANE_BITS;
    return ((RTI_VECTOR(int))((int)lanes) & bits) != 0;
}
)
RTI_SHARED(
RTI_FN rti_v rti_vset(float x) { return (rti_v)(x); }
RTI_FN rti_v rti_vid(uint32_t id) { return (rti_v)(as_float(id)); }
RTI_FN rti_v rti_vload(const float *p) { return RTI_VECTOR(vload)(0, p); }
RTI_FN void rti_vstore(float *p, rti_v a) { RTI_VECTOR(vstore)(a, 0, p); }
RTI_FN rti_v rti_lload(const __local float *p) { return RTI_VECTOR(vload)(0, p); }
RTI_FN void rti_lstore(__local float *p, rti_v a) { RTI_VECTOR(vstore)(a, 0, p); }
RTI_FN unsigned rti_vlt(rti_v a, rti_v b) { return RTI_VECTOR(rti_signs)(a < b); }
RTI_FN unsigned rti_vle(rti_v a, rti_v b) { return RTI_VECTOR(rti_signs)(a <= b); }
RTI_FN unsigned rti_vnegative(rti_v a) { return RTI_VECTOR(rti_signs)(RTI_VECTOR(as_int)(a)); }
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b) { return rti_spread_lanes(lanes) ? a : b; }
RTI_FN rti_d rti_dset(double x) { return (rti_d)(x); }
RTI_FN rti_d rti_dload(const double *p) { return RTI_VECTOR(vload)(0, p); }
RTI_FN void rti_dstore(double *p, rti_d a) { RTI_VECTOR(vstore)(a, 0, p); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b) { return RTI_VECTOR(rti_signs)(RTI_VECTOR(convert_int)(a < b)); }
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b) { return RTI_VECTOR(convert_long)(rti_spread_lanes(lanes)) ? a : b; }
RTI_FN rti_d rti_widen(rti_v a) { return RTI_VECTOR(convert_double)(a); }
RTI_FN rti_v rti_narrow(rti_d a) { return RTI_VECTOR(convert_float)(a); }
)

#endif

#if RTI_IN(EITHER)

/* What follows is the same for one lane and for many. Planes need not be met exactly, so fma may serve, where it is fast. */

/* RTI_APART keeps LLVM from gathering the planes of one ray into vectors, at which bvh.stack is a third slower. */
"#if defined(__clang__) && defined(__AVX__) && RTI_WIDTH == 1 && !RTI_GPU\n"
"#define RTI_APART(x) __asm__(\"\" : \"+x\"(x))\n"
"#else\n"
"#define RTI_APART(x) ((void)0)\n"
"#endif\n"
"#if RTI_FMA\n"
RTI_SHARED(
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return fma(a, b, c); }
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { return org * rdir; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org_rdir, rti_v rdir)
{
    rti_v t = fma(plane, rdir, -org_rdir);
    RTI_APART(t);
    return t;
}
)
"#else\n"
RTI_SHARED(
RTI_FN rti_v rti_vfma(rti_v a, rti_v b, rti_v c) { return a * b + c; }
RTI_FN rti_v rti_vorigin(rti_v org, rti_v rdir) { (void)rdir; return org; }
RTI_FN rti_v rti_vplane(rti_v plane, rti_v org, rti_v rdir) { return (plane - org) * rdir; }
)
"#endif\n"
RTI_SHARED(
RTI_FN rti_v rti_vadd(rti_v a, rti_v b) { return a + b; }
RTI_FN rti_v rti_vsub(rti_v a, rti_v b) { return a - b; }
RTI_FN rti_v rti_vmul(rti_v a, rti_v b) { return a * b; }
RTI_FN rti_v rti_vdiv(rti_v a, rti_v b) { return a / b; }
RTI_FN rti_v rti_vmin(rti_v a, rti_v b) { return a < b ? a : b; }
RTI_FN rti_v rti_vmax(rti_v a, rti_v b) { return a > b ? a : b; }
RTI_FN rti_v rti_vabs(rti_v a) { return fabs(a); }
RTI_FN rti_v rti_vsign(rti_v size, rti_v sign) { return copysign(size, sign); }
RTI_FN rti_v rti_vround(rti_v a) { return a; }
RTI_FN rti_d rti_dadd(rti_d a, rti_d b) { return a + b; }
RTI_FN rti_d rti_dsub(rti_d a, rti_d b) { return a - b; }
RTI_FN rti_d rti_dmul(rti_d a, rti_d b) { return a * b; }
RTI_FN rti_d rti_ddiv(rti_d a, rti_d b) { return a / b; }
RTI_FN rti_d rti_dsqrt(rti_d a) { return sqrt(a); }
RTI_FN rti_d rti_dmin(rti_d a, rti_d b) { return a < b ? a : b; }
RTI_FN rti_d rti_dmax(rti_d a, rti_d b) { return a > b ? a : b; }
RTI_FN rti_d rti_product(rti_d a, rti_d b) { return a * b; }
)

#endif

/* ---- run: rti_hit_run of rt.h, for one query ------------------------------------------------------------------------ */

#if RTI_IN(RUN)

RTI_SHARED(
RTI_FN unsigned rti_hit_run(const rt_accel *accel, rti_packet *p, unsigned lanes, const RTI_GLOBAL uint32_t *slots, uint32_t first,
                                  uint32_t count, uint32_t inst, const rti_job *job)
{
    return rti_hit_leaf(accel, p, lanes, slots, first, count, inst, RTI_WALK_FLAGS, job);
}
)

#endif

/* ---- threaded: [Lohr] 4 and 5 --------------------------------------------------------------------------------------- */

#if RTI_IN(THREADED_BODY)

/* From node to node along the links, without a stack; all rays of a packet go where one of them has to. A GPU reads the link beside the node,
   to wait once. A CPU guesses whether the node is hit and reads on: where the link waits for the test, all is in a row, 3 times slower. */
RTI_SHARED(
RTI_FN unsigned rti_thread_body(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const int flags, const rti_job *job)
{
    const bool round = RTI_IS_ROUND(accel);
    const RTI_GLOBAL rti_link *links;
    rti_slabs slabs;
    rti_sweep sweep;
    uint32_t at = 0, order = 0;
    unsigned found = 0;
    int i;
    for (i = 0; 1u << i < accel->orders; i++) order |= as_uint(p->dir[accel->order_axes[i]][0]) >> 31 << i;
    links = accel->links + (size_t)order * accel->node_count;
    if (round) sweep = rti_make_sweep(p);
    else slabs = rti_make_slabs(p);
    while (at != RTI_END) {
        const RTI_GLOBAL rti_node *node = accel->nodes + at;
        rti_v enter, leave;
        rti_link link;
        unsigned hit;
        if (RTI_GPU) link = links[at];
        if (round) hit = rti_meet_sphere(&sweep, node->bounds, rti_vload(p->t)) & live;
        else hit = rti_hit_box(&slabs, node->bounds, rti_vload(p->t), &enter, &leave) & live;
        if (!hit) {
            at = RTI_GPU ? link.miss : links[at].miss;
            continue;
        }
        at = RTI_GPU ? link.hit : links[at].hit;
        if (node->count) {
            hit = rti_hit_leaf(accel, p, hit, 0, node->index, node->count, inst, flags, job);
            found |= hit;
            if (flags & RTI_WALK_ANY && !(live &= ~hit)) break;
        }
    }
    return found;
}
)

#endif

/* ---- wide: one ray, 8 children at a time ---------------------------------------------------------------------------- */

#if RTI_IN(WIDE)

/* The children's boxes at once; enter: where the ray enters each. */
"#if RTI_GPU\n"
RTI_SHARED(
RTI_FN unsigned rti_hit_children(const rti_slabs *s, const RTI_GLOBAL rti_gpu_compact *node, float tmax, float *enter)
{
    const rti_slab slab[3] = { s->x, s->y, s->z };
    unsigned hit = 0;
    int i, k;
    RTI_UNROLL
    for (i = 0; i < 8; i++) {
        float from = s->tmin, to = tmax;
        RTI_UNROLL
        for (k = 0; k < 3; k++) {
            const float step = as_float((uint32_t)(node->exponent[k] + 127) << 23), origin = node->origin[k];
            const float near = rti_vplane(origin + step * node->bounds[slab[k].near_plane][i], slab[k].near_org, slab[k].rdir);
            const float far = rti_vplane(origin + step * node->bounds[slab[k].far_plane][i], slab[k].far_org, slab[k].rdir);
            from = near > from ? near : from;
            to = far < to ? far : to;
        }
        enter[i] = from;
        if (from <= to) hit |= 1u << i;
    }
    return hit;
}
)
"#else\n"
RTI_SHARED(
RTI_FN float8 rti_planes8(const RTI_GLOBAL rti_wide *node, int plane, float org, float rdir)
{
    const float8 planes = vload8(0, node->bounds[plane]);
    if (RTI_FMA) return fma(planes, (float8)(rdir), (float8)(-org));
    return (planes - org) * rdir;
}
RTI_FN float8 rti_min8(float8 a, float8 b) { return a < b ? a : b; }
RTI_FN float8 rti_max8(float8 a, float8 b) { return a > b ? a : b; }
RTI_FN unsigned rti_hit_children(const rti_slabs *s, const RTI_GLOBAL rti_wide *node, float tmax, float *enter)
{
    const float8 x0 = rti_planes8(node, s->x.near_plane, s->x.near_org, s->x.rdir), x1 = rti_planes8(node, s->x.far_plane, s->x.far_org, s->x.rdir);
    const float8 y0 = rti_planes8(node, s->y.near_plane, s->y.near_org, s->y.rdir), y1 = rti_planes8(node, s->y.far_plane, s->y.far_org, s->y.rdir);
    const float8 z0 = rti_planes8(node, s->z.near_plane, s->z.near_org, s->z.rdir), z1 = rti_planes8(node, s->z.far_plane, s->z.far_org, s->z.rdir);
    const float8 from = rti_max8(rti_max8(x0, y0), rti_max8(z0, (float8)(s->tmin)));
    const float8 to = rti_min8(rti_min8(x1, y1), rti_min8(z1, (float8)(tmax)));
    vstore8(from, 0, enter);
    return rti_signs8(from <= to);
}
)
"#endif\n"

#endif

#if RTI_IN(WIDE_BODY)

/* Depth first, the nearest child first. What waits lies on a stack, the nearest on top, and is looked at again only where the ray is still
   long enough. */
RTI_SHARED(
RTI_FN unsigned rti_wide_body(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const int flags, const rti_job *job)
{
    struct { uint32_t index, count; float enter; } stack[RTI_STACK], next;
    const rti_slabs s = rti_make_slabs(p);
    unsigned found = 0;
    int top = 0;
    next.index = next.count = 0;
    for (;;) {
        if (next.count) {
            const unsigned hit = rti_hit_leaf(accel, p, live, 0, next.index, next.count, inst, flags, job);
            found |= hit;
            if (flags & RTI_WALK_ANY && hit) return found;
        } else {
            const RTI_GLOBAL RTI_WIDE_NODE *node = accel->wide + next.index;
            float enter[8];
            unsigned hit = rti_hit_children(&s, node, p->t[0], enter);
            const int base = top;
            while (hit) {
                const int i = 31 - (int)clz(hit & (0u - hit));
                int at = top;
                hit &= hit - 1;
                if (!(node->index[i] | node->count[i])) continue;
                top++;
                if (!(flags & RTI_WALK_ANY))
                    for (; at > base && stack[at - 1].enter < enter[i]; at--) stack[at] = stack[at - 1];
                stack[at].index = node->index[i];
                stack[at].count = node->count[i];
                stack[at].enter = enter[i];
            }
        }
        do {
            if (!top) return found;
            next = stack[--top];
        } while (!(flags & RTI_WALK_ANY) && !(next.enter <= p->t[0]));
    }
}
)

#endif

/* ---- walk: through an accel of one level ---------------------------------------------------------------------------- */

#if RTI_IN(WALK)

/* Planes first: what is behind them need not be looked at. */
RTI_SHARED(
RTI_CALL unsigned rti_walk(const rt_accel *accel, rti_packet *p, unsigned live, uint32_t inst, const rti_job *job)
{
    unsigned found = 0;
    if (RTI_HAS_PLANES && accel->plane_count && live) {
        found = rti_hit_planes(accel, p, live, inst, job);
        if (RTI_WALK_FLAGS & RTI_WALK_ANY) live &= ~found;
    }
    if (!accel->node_count || !live) return found;
    if (RTI_IS_KDTREE(accel)) {
        if (job->algorithm == RT_KD_STACK || (job->algorithm == RT_KD_BACKTRACK && !accel->kdlinks)) return found | rti_kd_stack_body(accel, p, live, inst, RTI_WALK_FLAGS, job);
        return found | rti_kd_restart_body(accel, p, live, inst, RTI_WALK_FLAGS, job);
    }
    if (RTI_IS_THREADED(accel)) return found | rti_thread_body(accel, p, live, inst, RTI_WALK_FLAGS, job);
    return found | rti_walk_bvh(accel, p, live, inst, RTI_WALK_FLAGS, job);
}
)

#endif

/* ---- rays: to lanes, and their hits back ---------------------------------------------------------------------------- */

#if RTI_IN(RAYS)

RTI_SHARED(
RTI_FN unsigned rti_take_rays(const rt_accel *accel, const RTI_GLOBAL rt_ray *rays, const RTI_GLOBAL float *times, size_t first, size_t last,
                              rti_packet *p)
{
    int i;
    RTI_UNROLL
    for (i = 0; i < RTI_WIDTH; i++) {
        const size_t at = first + (size_t)i < last ? first + (size_t)i : last - 1;
        const rt_ray ray = rays[at];
        p->org[0][i] = ray.org.x;
        p->org[1][i] = ray.org.y;
        p->org[2][i] = ray.org.z;
        p->dir[0][i] = ray.dir.x;
        p->dir[1][i] = ray.dir.y;
        p->dir[2][i] = ray.dir.z;
        p->tmin[i] = ray.tmin;
        p->t[i] = ray.tmax;
        if (RTI_MOVES) p->time[i] = times ? rti_clamp_time(times[at]) : 0;
    }
    rti_no_hits(p);
    return last - first < RTI_WIDTH ? (1u << (last - first)) - 1 : RTI_ALL_LANES;
}

RTI_FN void rti_give_hits(const rti_packet *p, unsigned found, RTI_GLOBAL rt_hit *hits, size_t first, size_t last)
{
    const bool any = (RTI_WALK_FLAGS & RTI_WALK_ANY) != 0;
    int i;
    for (i = 0; i < RTI_WIDTH && first + (size_t)i < last; i++) {
        const bool hit = found >> i & 1;
        rt_hit h;
        h.t = !hit ? RTI_INFINITY : any ? 0 : p->t[i];
        h.u = p->u[i];
        h.v = p->v[i];
        h.prim = hit ? p->prim.id[i] : RT_NONE;
        h.inst = hit && !any ? p->inst.id[i] : RT_NONE;
        hits[first + (size_t)i] = h;
    }
}
)

#endif

/* ---- trace: the kernel of batches of rays --------------------------------------------------------------------------- */

#if RTI_IN(TRACE)

RTI_SHARED(
RTI_CALL void rti_trace_packet(const RTI_GLOBAL char *arena, const RTI_GLOBAL rt_ray *rays, RTI_GLOBAL rt_hit *hits,
                               const RTI_GLOBAL float *times, size_t first, size_t last, rt_algorithm algorithm, int entries)
{
    rt_accel accel;
    rti_packet p;
    rti_job job;
    unsigned live;
    rti_open(&accel, arena, 0);
    job.query = RTI_QUERY;
    job.algorithm = algorithm;
    job.entries = entries;
    live = rti_prepare(&accel, &p, rti_take_rays(&accel, rays, times, first, last, &p), false);
    rti_give_hits(&p, rti_walk(&accel, &p, live, RT_NONE, &job), hits, first, last);
}
)

/* Work-item i: the rays from i * RTI_WIDTH on, of count from base on. A program for one algorithm has it as a constant. */
RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_trace(__global const char *arena, __global const rt_ray *rays, __global rt_hit *hits, __global const float *times,
                           ulong base, ulong count, int algorithm, int entries)
{
    const size_t first = get_global_id(0) * RTI_WIDTH;
    if (first < count) rti_trace_packet(arena, rays, hits, times, base + first, base + count, RTI_ALGORITHM, RTI_ENTRIES);
}
)

#endif

/* ---- large: [Overbeck] 3 and 4, a packet a work-group --------------------------------------------------------------- */

#if RTI_IN(LARGE)

/* Each work-item has a SIMD ray, RTI_WIDTH rays of the packet, and all go down the tree together: where they go is the same for all, and
   barriers stand at fixed places of a step, none in a branch. At a leaf each SIMD ray asks for the box itself.

   On a GPU work-items ask for a box together, and a step is a node. On a CPU they take turns from barrier to barrier: there the first goes on
   alone, asking for the others, until it comes to a leaf, and a step is a leaf. For that it reads their rays in local memory, as work-items
   do with Partition on a GPU, where they ask for other rays than their own. */
"#define RTI_STRIPS 16\n"
RTI_SHARED(
typedef struct { uint32_t first, open, words[32]; } rti_votes;      /* of a step: the first that meets the box; whether any needs hits; who does */
typedef struct { uint32_t leaf, active, over, open; } rti_lead;     /* what the first work-item tells the others */

typedef struct {
    const RTI_GLOBAL rti_node *nodes;
    rt_algorithm algorithm;
    int cull;                               /* RT_CULL_NONE where there is no frustum */
    uint32_t item, items;                   /* of the group; an item's number is that of its SIMD ray */
    rti_packet *ray;
    unsigned live;                          /* lanes of it that need hits */
    uint32_t at, top, turn;                 /* the node to ask for, entries of the stack, and which of the votes are cast next */
    uint32_t active;                        /* Ranged: the first SIMD ray that is, Partition: how many ids are; Masked: 0 */
    uint32_t leaf, leaf_active;             /* what the step has come to, and active there; RT_NONE: to no leaf */
    bool over;
    __local uint32_t (*stack)[2];           /* nodes, and how many were active */
    __local float *rays;                    /* see rti_row */
    __local ushort *ids;                    /* Partition: SIMD rays, those that are active first, */
    __local ushort *ranks;                  /* and where each of them stands; */
    __local ushort *sides;                  /* bits of their signs, and 8: all lanes have them */
    __local rti_votes *votes;               /* three, which take turns */
    __local float *strips;                  /* of rti_survey */
    const __local float *way;               /* the dir of one ray */
    const __local rti_frustum *frustum;
} rti_group;
)

/* What box tests read of a SIMD ray: numbers side by side, t first. A GPU has little local memory: it makes planes of org and pad again, and a
   row of all SIMD rays lies together. Lanes that need no more hits have an empty interval. */
RTI_SHARED(
RTI_FN __local float *rti_row(const rti_group *g, uint32_t at, uint32_t n)
{
    return g->rays + (RTI_GPU ? n * g->items + at : at * RTI_ROWS + n) * RTI_WIDTH;
}

RTI_FN void rti_share_t(const rti_group *g)
{
    rti_lstore(rti_row(g, g->item, 0), rti_vselect(g->live, rti_vload(g->ray->t), rti_vset(-RTI_INFINITY)));
}

RTI_FN void rti_share_ray(const rti_group *g)
{
    const rti_packet *p = g->ray;
    uint32_t k;
    rti_share_t(g);
    rti_lstore(rti_row(g, g->item, 1), rti_vselect(g->live, rti_vload(p->tmin), rti_vset(RTI_INFINITY)));
    for (k = 0; k < 3; k++) {
        rti_lstore(rti_row(g, g->item, 2 + k), rti_vload(p->rdir[k]));
        rti_lstore(rti_row(g, g->item, 5 + k), rti_vload(RTI_GPU ? p->org[k] : p->plane[0][k]));
        if (!RTI_GPU) rti_lstore(rti_row(g, g->item, 8 + k), rti_vload(p->plane[1][k]));
    }
    if (RTI_GPU) rti_lstore(rti_row(g, g->item, 8), rti_vload(p->pad));
    g->sides[g->item] = !g->live ? 8 : (ushort)(p->side[0] | p->side[1] << 1 | p->side[2] << 2 | (RTI_KNOWN_SIDES(p) ? 8 : 0));
    g->ids[g->item] = g->ranks[g->item] = (ushort)g->item;
}

RTI_FN rti_slab rti_shared_slab(const rti_group *g, uint32_t at, uint32_t sides, uint32_t k)
{
    const uint32_t side = sides & 8 ? sides >> k & 1 : 0;
    rti_slab s;
    s.rdir = rti_lload(rti_row(g, at, 2 + k));
    if (RTI_GPU) {
        const rti_v org = rti_lload(rti_row(g, at, 5 + k)), pad = rti_lload(rti_row(g, at, 8));
        s.near_org = rti_vorigin(side ? org - pad : org + pad, s.rdir);
        s.far_org = rti_vorigin(side ? org + pad : org - pad, s.rdir);
    } else {
        s.near_org = rti_lload(rti_row(g, at, 5 + 3 * side + k));
        s.far_org = rti_lload(rti_row(g, at, 8 - 3 * side + k));
    }
    s.near_plane = (int)(3 * side + k);
    s.far_plane = (int)(3 - 3 * side + k);
    return s;
}

/* Lanes that meet the box. */
RTI_FN unsigned rti_meet(const rti_packet *p, unsigned lanes, const RTI_GLOBAL float *bounds)
{
    const rti_slabs s = rti_make_slabs(p);
    rti_v enter, leave;
    return rti_hit_box(&s, bounds, rti_vload(p->t), &enter, &leave) & lanes;
}

/* Does any of that SIMD ray, which is one's own where none are shared? */
RTI_FN bool rti_meets(const rti_group *g, uint32_t at, const RTI_GLOBAL float *bounds)
{
    rti_slabs s;
    rti_v enter, leave;
    uint32_t sides;
    if (!RTI_SHARES) return rti_meet(g->ray, g->live, bounds) != 0;
    sides = g->sides[at];
    s.uniform = RTI_WIDTH == 1 || sides & 8;
    s.tmin = rti_lload(rti_row(g, at, 1));
    s.x = rti_shared_slab(g, at, sides, 0);
    s.y = rti_shared_slab(g, at, sides, 1);
    s.z = rti_shared_slab(g, at, sides, 2);
    return rti_hit_box(&s, bounds, rti_lload(rti_row(g, at, 0)), &enter, &leave) != 0;
}
)

/* [Overbeck] 4, see >>frustum of rt.h: around the rays of all work-items. */
RTI_SHARED(
typedef struct { float low[4], high[4]; } rti_range;

RTI_FN float rti_high1(float a) { return a; }
RTI_FN float rti_high2(float2 a) { return rti_maxf(a.x, a.y); }
RTI_FN float rti_high4(float4 a) { return rti_high2(a.lo > a.hi ? a.lo : a.hi); }
RTI_FN float rti_high8(float8 a) { return rti_high4(a.lo > a.hi ? a.lo : a.hi); }
RTI_FN float rti_high16(float16 a) { return rti_high8(a.lo > a.hi ? a.lo : a.hi); }
RTI_FN float rti_highest(unsigned live, rti_v a) { return RTI_VECTOR(rti_high)(rti_vselect(live, a, rti_vset(-RTI_INFINITY))); }

/* Least and greatest of four numbers of all rays, for all to know: work-items are gathered in strips, and each gathers the strips. */
RTI_FN rti_range rti_survey(const rti_group *g, rti_v a, rti_v b, rti_v c, rti_v d)
{
    const uint32_t count = g->items < RTI_STRIPS ? g->items : RTI_STRIPS;
    float8 most = (float8)(rti_highest(g->live, a), rti_highest(g->live, b), rti_highest(g->live, c), rti_highest(g->live, d),
                           rti_highest(g->live, -a), rti_highest(g->live, -b), rti_highest(g->live, -c), rti_highest(g->live, -d));
    rti_range r;
    uint32_t i;
    vstore8(most, g->item, g->rays);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (g->item < count) {
        for (i = g->item + count; i < g->items; i += count) {
            const float8 other = vload8(i, g->rays);
            most = other > most ? other : most;
        }
        vstore8(most, g->item, g->strips);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    most = vload8(0, g->strips);
    for (i = 1; i < count; i++) {
        const float8 other = vload8(i, g->strips);
        most = other > most ? other : most;
    }
    vstore4(most.lo, 0, r.high);
    vstore4(-most.hi, 0, r.low);
    return r;
}

RTI_FN rti_v rti_pick(const float lanes[3][RTI_WIDTH], int k) { return rti_vload(k == 0 ? lanes[0] : k == 1 ? lanes[1] : lanes[2]); }
)

/* False: there is none. */
RTI_SHARED(
RTI_FN bool rti_make_frustum(const rt_accel *accel, const rti_group *g, rti_frustum *f)
{
    const rti_packet *p = g->ray;
    const rti_v org[3] = { rti_vload(p->org[0]), rti_vload(p->org[1]), rti_vload(p->org[2]) };
    const rti_v dir[3] = { rti_vload(p->dir[0]), rti_vload(p->dir[1]), rti_vload(p->dir[2]) };
    const rti_range orgs = rti_survey(g, org[0], org[1], org[2], rti_vload(p->tmin));
    const rti_range dirs = rti_survey(g, dir[0], dir[1], dir[2], rti_vload(p->t));
    const rti_range ends = rti_survey(g, org[0] + dir[0], org[1] + dir[1], org[2] + dir[2], rti_vload(p->pad));
    rti_v rdir, slope_u, slope_v, back, length, u, v;
    rti_range slopes, crossed;
    rti_bundle b;
    bool fits;
    int k;
    b.tmin = orgs.low[3];
    b.tmax = dirs.high[3];
    b.pad = ends.high[3];
    for (k = 0; k < 3; k++) {
        b.org_low[k] = orgs.low[k];
        b.org_high[k] = orgs.high[k];
        b.end_low[k] = ends.low[k];
        b.end_high[k] = ends.high[k];
        b.way[k] = dirs.low[k] * 0.5f + dirs.high[k] * 0.5f;
        b.sides[k] = (dirs.high[k] > 0 ? 1 : 0) | (dirs.low[k] < 0 ? 2 : 0);
    }
    fits = rti_aim_frustum(accel, &b, f);

    rdir = rti_pick(p->rdir, f->k);
    slope_u = rti_pick(p->dir, f->u) * rdir;
    slope_v = rti_pick(p->dir, f->v) * rdir;
    slopes = rti_survey(g, slope_u, slope_v, rti_pick(p->dir, f->k) * rti_vset(f->sign), rti_vset(0));
    for (k = 0; k < 2; k++) {
        f->low[k] = slopes.low[k];
        f->high[k] = slopes.high[k];
    }
    fits = rti_span_frustum(accel, &b, f, slopes.low[2]) && fits;

    back = rti_vset(f->start) - rti_pick(p->org, f->k);
    length = rti_vset(f->length * f->sign);
    u = rti_pick(p->org, f->u) + slope_u * back;
    v = rti_pick(p->org, f->v) + slope_v * back;
    crossed = rti_survey(g, u, v, u + slope_u * length, v + slope_v * length);      /* needed or not: PoCL copies all behind a branch with barriers */
    if (f->sway < 0)
        for (k = 0; k < 2; k++) rti_set_sides(f, k, crossed.low[k], crossed.high[k], crossed.low[2 + k], crossed.high[2 + k]);
    rti_close_frustum(f);
    return fits;
}
)

/* Does no ray meet the box? As rti_cull_box of rt.h. */
RTI_SHARED(
RTI_FN bool rti_cull_box(const rti_group *g, const RTI_GLOBAL float *bounds)
{
    const __local rti_frustum *f = g->frustum;
    if (g->cull) {
        const float at = f->sign * f->start, lo = f->sign * bounds[f->near_k] - at - f->pad, hi = f->sign * bounds[f->far_k] - at + f->pad;
        const float from = lo > 0 ? lo : 0, to = hi < f->length ? hi : f->length;
        const float4 most = (float4)(bounds[3 + f->u], -bounds[f->u], bounds[3 + f->v], -bounds[f->v]);
        const float4 room = most - vload4(0, f->outside), slope = vload4(0, f->slope);
        if (from > to) return true;
        if (g->cull & RT_CULL_PLANES) {
            const float4 a = slope * from, b = slope * to;
            if (any(room < (a < b ? a : b))) return true;
        }
        if (g->cull & RT_CULL_CORNERS) {
            const float4 s = room * vload4(0, f->rslope), beyond = vload4(0, f->beyond);
            const float4 later = s > beyond ? s : beyond, sooner = s < beyond ? s : beyond;
            const float4 last = later < to ? later : (float4)(to), first = sooner > from ? sooner : (float4)(from);
            return rti_maxf(rti_maxf(first.x, first.y), rti_maxf(first.z, first.w)) > -rti_maxf(rti_maxf(-last.x, -last.y), rti_maxf(-last.z, -last.w));
        }
    }
    return false;
}
)

/* Who meets the box of an inner node, or may meet that of a leaf. Answers what active becomes: of Partition how many do, which come to the
   front of ids; else the first that does, items: none. */
"#if RTI_GPU\n"
/* All cast their votes, and know of all. Those of the next step are cleared a step before: all have read them before the last barrier. */
RTI_SHARED(
RTI_FN const __local rti_votes *rti_count_votes(rti_group *g, bool meets)
{
    const uint32_t next = g->turn == 2 ? 0 : g->turn + 1;
    __local rti_votes *votes = g->votes + g->turn;
    if (meets && g->algorithm == RT_BVH_PARTITION) atomic_or(&votes->words[g->item / 32], 1u << g->item % 32);
    else if (meets) atomic_min(&votes->first, g->item);
    if (g->live) votes->open = 1;
    if (!g->item) {
        g->votes[next].first = g->items;
        g->votes[next].open = 0;
    }
    if (g->item % 32 == 0) g->votes[next].words[g->item / 32] = 0;
    g->turn = next;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!votes->open) g->top = 0;
    return votes;
}

RTI_FN uint32_t rti_ask(rti_group *g, const RTI_GLOBAL rti_node *node)
{
    const bool partition = g->algorithm == RT_BVH_PARTITION, mine = partition ? g->item < g->active : g->item >= g->active;
    const uint32_t ray = partition ? g->ids[g->item] : g->item;
    const bool hit = mine && !rti_cull_box(g, node->bounds) && rti_meets(g, ray, node->bounds);
    const __local rti_votes *votes = rti_count_votes(g, hit);
    uint32_t i, before = 0, all = 0;
    if (!partition) return votes->first;
    for (i = 0; i * 32 < g->active; i++) {
        const uint32_t word = votes->words[i], behind = g->item - i * 32;
        all += popcount(word);
        if (i * 32 <= g->item) before += popcount(behind < 32 ? word & ((1u << behind) - 1) : word);
    }
    if (node->count) return all ? g->active : 0;
    if (mine) {                             /* an entry's place is told by the votes that stand before its own */
        const uint32_t place = hit ? before : all + g->item - before;
        g->ids[place] = (ushort)ray;
        g->ranks[ray] = (ushort)place;
    }
    return all;
}
)
"#else\n"
/* [Overbeck] 3.2, getFirstHit, and 3.3, partRays. */
RTI_SHARED(
RTI_FN uint32_t rti_first_hit(const rti_group *g, const RTI_GLOBAL float *bounds)
{
    uint32_t i = g->active;
    if (rti_meets(g, i, bounds)) return i;
    if (rti_cull_box(g, bounds)) return g->items;
    while (++i < g->items && !rti_meets(g, i, bounds)) {}
    return i;
}

RTI_FN uint32_t rti_part_rays(const rti_group *g, const RTI_GLOBAL float *bounds)
{
    uint32_t i, alive = 0;
    if (rti_cull_box(g, bounds)) return 0;
    for (i = 0; i < g->active; i++) {
        const ushort id = g->ids[i], other = g->ids[alive];
        if (!rti_meets(g, id, bounds)) continue;
        g->ids[i] = other;
        g->ranks[other] = (ushort)i;
        g->ids[alive] = id;
        g->ranks[id] = (ushort)alive++;
    }
    return alive;
}

RTI_FN uint32_t rti_ask(rti_group *g, const RTI_GLOBAL rti_node *node)
{
    const bool partition = g->algorithm == RT_BVH_PARTITION;
    if (!node->count) return partition ? rti_part_rays(g, node->bounds) : rti_first_hit(g, node->bounds);
    return !rti_cull_box(g, node->bounds) ? g->active : partition ? 0 : g->items;
}
)
"#endif\n"

/* A node. [Overbeck] Figure 2, A.1 and A.2 in one, as rti_large_body of rt.h: what differs is which SIMD rays stay active. The first work-item
   notes what waits, which is read behind the next barrier at the soonest. */
RTI_SHARED(
RTI_FN void rti_step(rti_group *g)
{
    const RTI_GLOBAL rti_node *node = g->nodes + g->at;
    const uint32_t active = rti_ask(g, node);
    const bool alive = g->algorithm == RT_BVH_PARTITION ? active > 0 : active < g->items;
    if (g->algorithm != RT_BVH_MASKED) g->active = active;
    g->leaf = alive && node->count ? g->at : RT_NONE;
    g->leaf_active = g->active;
    if (alive && !node->count) {            /* the child whose middle comes first along the way is near */
        const RTI_GLOBAL float *a = g->nodes[node->index].bounds;
        const RTI_GLOBAL float *b = g->nodes[node->index + 1].bounds;
        const float ahead = g->way[0] * (b[0] - a[0] + (b[3] - a[3])) + g->way[1] * (b[1] - a[1] + (b[4] - a[4])) +
                            g->way[2] * (b[2] - a[2] + (b[5] - a[5]));
        const uint32_t near = ahead < 0 ? 1 : 0;
        if (!g->item) {
            g->stack[g->top][0] = node->index + 1 - near;
            g->stack[g->top][1] = g->active;
        }
        g->top++;
        g->at = node->index + near;
    } else {
        g->over = !g->top;
        if (!g->over) g->top--;
        g->at = g->stack[g->top][0];
        g->active = g->stack[g->top][1];
    }
}

RTI_NOINLINE unsigned rti_large_leaf(const rt_accel *accel, rti_packet *p, unsigned lanes, const RTI_GLOBAL rti_node *leaf, const rti_job *job)
{
    lanes = rti_meet(p, lanes, leaf->bounds);
    return lanes ? rti_hit_leaf(accel, p, lanes, 0, leaf->index, leaf->count, RT_NONE, RTI_WALK_FLAGS, job) : 0;
}
)

/* Local memory: rows, and before them room for rti_survey; ids, ranks and sides. A program for one algorithm and way to cull has them as
   constants. */
RTI_SHARED(
__kernel void rt_gpu_trace(__global const char *arena, __global const rt_ray *rays, __global rt_hit *hits, __global const float *times,
                           ulong base, ulong count, int algorithm, int cull, __local float *rows, __local ushort *numbers)
{
    __local uint32_t stack[RTI_STACK][2];
    __local float strips[8 * RTI_STRIPS], way[3];
    __local rti_frustum frustum;
    __local rti_votes votes[RTI_GPU ? 3 : 1];
    __local rti_lead lead;
    const bool any = RTI_QUERY == RT_ANY;
    const uint32_t item = get_local_id(0), items = get_local_size(0);
    const size_t last = base + count, first = base + (get_group_id(0) * items + item) * RTI_WIDTH;
    rt_accel accel;
    rti_packet p;
    rti_job job;
    rti_group g;
    unsigned found = 0, live;
    rti_open(&accel, arena, 0);
    job.query = RTI_QUERY;
    job.algorithm = RTI_ALGORITHM;
    job.entries = 0;
    live = rti_take_rays(&accel, rays, times, first < last ? first : last - 1, last, &p);
    live = rti_prepare(&accel, &p, first < last ? live : 0, false);
    if (RTI_HAS_PLANES && accel.plane_count && live) {
        found = rti_hit_planes(&accel, &p, live, RT_NONE, &job);
        if (any) live &= ~found;
    }
    g.nodes = accel.nodes;
    g.algorithm = RTI_ALGORITHM;
    g.cull = RTI_CULL;
    g.item = item;
    g.items = items;
    g.ray = &p;
    g.live = accel.node_count ? live : 0;
    g.at = g.top = g.turn = g.active = 0;
    g.leaf = RT_NONE;
    g.over = false;
    g.stack = stack;
    g.rays = rows;
    g.ids = numbers;
    g.ranks = numbers + items;
    g.sides = numbers + 2 * items;
    g.votes = votes;
    g.strips = strips;
    g.way = way;
    g.frustum = &frustum;
    if (g.algorithm == RT_BVH_PARTITION) g.active = items;
)
RTI_SHARED(
    if (RTI_CULLS) {
        rti_frustum f;
        if (!rti_make_frustum(&accel, &g, &f)) g.cull = RT_CULL_NONE;
        if (!item) frustum = f;
    }
    if (RTI_SHARES) rti_share_ray(&g);
    if (item == items / 2) {
        way[0] = p.dir[0][0];
        way[1] = p.dir[1][0];
        way[2] = p.dir[2][0];
    }
    if (!item) {
        votes[0].first = items;
        votes[0].open = 0;
        lead.open = 1;
        stack[0][0] = stack[0][1] = 0;
    }
    if (item % 32 == 0) votes[0].words[item / 32] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    do {
)
"#if RTI_GPU\n"
RTI_SHARED(
        rti_step(&g);
)
"#else\n"
RTI_SHARED(
        if (!item) {
            if (!lead.open) g.over = true;
            g.leaf = RT_NONE;
            while (!g.over && g.leaf == RT_NONE) rti_step(&g);
            lead.leaf = g.leaf;
            lead.active = g.leaf_active;
            lead.over = g.over;
            lead.open = 0;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        g.leaf = lead.leaf;
        g.leaf_active = lead.active;
        g.over = lead.over;
)
"#endif\n"
RTI_SHARED(
        if (g.leaf != RT_NONE && g.live && (g.algorithm == RT_BVH_PARTITION ? g.ranks[item] < g.leaf_active : item >= g.leaf_active)) {
            const unsigned hit = rti_large_leaf(&accel, &p, g.live, accel.nodes + g.leaf, &job);
            found |= hit;
            if (any) g.live &= ~hit;
            if (hit && RTI_SHARES) rti_share_t(&g);
        }
        if (!RTI_GPU && g.live) lead.open = 1;
        if (RTI_SHARES) barrier(CLK_LOCAL_MEM_FENCE);
    } while (!g.over);
    rti_give_hits(&p, found, hits, first, last);
}
)

#endif

/* ---- scene: what rt_gpu_upload_scene copies, the same as C and on the device ---------------------------------------- */

#if RTI_IN(SCENE)

/* Where rt.h has pointers, distances in bytes from the thing itself, 0: none; those of parts from where they are told. */
RTI_SHARED(
typedef struct { int64_t levels; uint32_t kind, solid; int32_t width, height; rt_vec3 colors[2]; float size; uint32_t unused; } rti_gpu_texture;
typedef struct {
    int64_t texture, bump;
    rt_vec3 diffuse, specular, emission, reflect, transmit, absorb;
    float shininess, ior, roughness, bump_height;
    uint32_t fresnel, unused;
} rti_gpu_material;
typedef struct { rt_vec3 position, color, edges[2]; float radius; uint32_t by_area; } rti_gpu_light;
)

/* What shades the primitives of an accel, see rti_shape of rt.h; parts: the distances of those of its instances. The outermost stands first. */
RTI_SHARED(
typedef struct {
    int64_t vertices, indices, normals, normal_indices, colors, texcoords, texcoord_indices, materials, material_ids, spheres, planes, parts;
    uint32_t stride, triangle_count, instance_count, tree_count;
} rti_gpu_shape;
typedef char rti_check_texture_record[sizeof(rti_gpu_texture) == 56 ? 1 : -1];
typedef char rti_check_material_record[sizeof(rti_gpu_material) == 112 ? 1 : -1];
typedef char rti_check_light_record[sizeof(rti_gpu_light) == 56 ? 1 : -1];
typedef char rti_check_shape_record[sizeof(rti_gpu_shape) == 112 ? 1 : -1];
)

/* What all steps of a tile have in common: rti_film and rti_world of rt.h, and how its memory is laid out, see rti_work. */
RTI_SHARED(
typedef struct {
    rt_vec3 view[4], lens_right, lens_down, ambient, background;
    float rfocus, open, length, angle, dx, dy;
    uint32_t left, top, width, height;      /* of the tile */
    uint32_t sample, spp, seed, frame, sampler, filter, lens_open, timed, spread, light_pairs;
    uint32_t chosen;                        /* the pixels with rays are listed */
    uint32_t depth, space, waiting;         /* pixels that there is room for, and for how many rays that wait for each of them */
    uint32_t lights;                        /* where they are, as the arrays of an accel */
} rti_gpu_frame;
typedef struct { rt_vec3 sum; uint32_t waiting, shadow, reflect, refract; } rti_gpu_pixel;              /* rays that wait; and were sent,
                                                                                                           2^32 at most */
typedef struct { rt_vec3 weight; uint32_t pixel, medium, level, branch; float width, time; } rti_gpu_path;     /* rti_path; medium as lights */
typedef struct { float lo[2], hi[2], depth; } rti_gpu_span;
typedef struct {                            /* rt_raster: see rti_span and rti_level of rt.h; arrays as those of an accel */
    uint32_t level_count, shifts[17], columns[17], firsts[17], triangle_count, solid_count, spans, starts, entries, slots;
} rti_gpu_raster;
typedef char rti_check_frame[sizeof(rti_gpu_frame) == 196 ? 1 : -1];
typedef char rti_check_pixel[sizeof(rti_gpu_pixel) == 28 ? 1 : -1];
typedef char rti_check_path[sizeof(rti_gpu_path) == 36 ? 1 : -1];
typedef char rti_check_span[sizeof(rti_gpu_span) == 20 ? 1 : -1];
)

#endif

/* ---- cover: eye rays without a tree, [Horn] 4 ----------------------------------------------------------------------- */

#if RTI_IN(COVER)

/* Where the primitives that tiles list are in the arrays of the accel. */
RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_find_slots(__global const char *arena, __global char *raster)
{
    const RTI_GLOBAL rti_gpu_raster *const r = (const RTI_GLOBAL rti_gpu_raster *)raster;
    RTI_GLOBAL uint32_t *const slots = (RTI_GLOBAL uint32_t *)(raster + (size_t)r->slots * RTI_GPU_ALIGN);
    uint32_t i = (uint32_t)get_global_id(0);
    rt_accel accel;
    rti_open(&accel, arena, 0);
    if (i < accel.slots[RTI_TRIANGLE]) slots[accel.triangles[i].prim] = i;
    if (i < accel.slots[RTI_SPHERE]) slots[accel.balls[i].prim] = i;
)
#if RTI_INSTANCES
RTI_SHARED(
    if (i < accel.slots[RTI_INSTANCE]) slots[accel.instances[i].prim] = i;
)
#endif
RTI_SHARED(
}
)

/* What of the raster's tiles may cover one packet of eye rays, whose samples lie in box: x0, y0, x1, y1. */
RTI_SHARED(
RTI_FN unsigned rti_cover_packet(const rt_accel *accel, const RTI_GLOBAL char *raster, const float box[4], rti_packet *p, unsigned live,
                                 const rti_job *job)
{
    const RTI_GLOBAL rti_gpu_raster *const r = (const RTI_GLOBAL rti_gpu_raster *)raster;
    const RTI_GLOBAL rti_gpu_span *const spans = (const RTI_GLOBAL rti_gpu_span *)(raster + (size_t)r->spans * RTI_GPU_ALIGN);
    const RTI_GLOBAL uint32_t *const starts = (const RTI_GLOBAL uint32_t *)(raster + (size_t)r->starts * RTI_GPU_ALIGN);
    const RTI_GLOBAL uint32_t *const entries = (const RTI_GLOBAL uint32_t *)(raster + (size_t)r->entries * RTI_GPU_ALIGN);
    const RTI_GLOBAL uint32_t *const slots = (const RTI_GLOBAL uint32_t *)(raster + (size_t)r->slots * RTI_GPU_ALIGN);
    float farthest = RTI_INFINITY;
    unsigned found = 0;
    uint32_t level;
    uint32_t x;
    uint32_t y;
    uint32_t at;
    int i;
    if (RTI_HAS_PLANES && accel->plane_count) found = rti_hit_planes(accel, p, live, RT_NONE, job);
    for (level = 0; level < r->level_count; level++)
        for (y = (uint32_t)box[1] >> r->shifts[level]; y <= (uint32_t)box[3] >> r->shifts[level]; y++)
            for (x = (uint32_t)box[0] >> r->shifts[level]; x <= (uint32_t)box[2] >> r->shifts[level]; x++) {
                const uint32_t tile = r->firsts[level] + y * r->columns[level] + x;
                for (at = starts[tile]; at < starts[tile + 1]; at++) {
                    const uint32_t prim = entries[at];
                    const uint32_t kind = prim < r->triangle_count ? RTI_TRIANGLE : prim < r->solid_count ? RTI_SPHERE : RTI_INSTANCE;
                    const rti_gpu_span span = spans[prim];
                    unsigned hit;
                    if (span.lo[0] > box[2] || span.hi[0] < box[0] || span.lo[1] > box[3] || span.hi[1] < box[1]) continue;
                    if (span.depth > farthest || slots[prim] == RT_NONE) continue;
                    hit = rti_hit_leaf(accel, p, live, 0, slots[prim], kind << RTI_KIND_SHIFT | 1, RT_NONE, RTI_WALK_FLAGS, job);
                    if (!hit) continue;
                    found |= hit;
                    farthest = p->t[0];
                    for (i = 1; i < RTI_WIDTH; i++) farthest = p->t[i] > farthest ? p->t[i] : farthest;
                }
            }
    return found;
}
)

/* Work-item i: the eye rays from i * RTI_WIDTH on, of a tile of the picture. */
RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_cover(__global const char *arena, __global const rt_ray *rays, __global rt_hit *hits, __global const char *raster,
                           rti_gpu_frame frame, int algorithm, int entries)
{
    const size_t first = get_global_id(0) * RTI_WIDTH;
    const size_t count = frame.width * frame.height;
    float box[4] = { RTI_INFINITY, RTI_INFINITY, 0, 0 };
    rt_accel accel;
    rti_packet p;
    rti_job job;
    unsigned live;
    int i;
    if (first >= count) return;
    for (i = 0; i < RTI_WIDTH; i++) {
        const uint32_t place = rti_place_of((uint32_t)min(first + i, count - 1), frame.width, frame.height);
        const float x = (float)(frame.left + place % frame.width) + frame.dx, y = (float)(frame.top + place / frame.width) + frame.dy;
        box[0] = x < box[0] ? x : box[0];
        box[1] = y < box[1] ? y : box[1];
        box[2] = x > box[2] ? x : box[2];
        box[3] = y > box[3] ? y : box[3];
    }
    rti_open(&accel, arena, 0);
    job.query = RT_CLOSEST;
    job.algorithm = RTI_ALGORITHM;
    job.entries = RTI_ENTRIES;
    live = rti_prepare(&accel, &p, rti_take_rays(&accel, rays, 0, first, count, &p), false);
    rti_give_hits(&p, rti_cover_packet(&accel, raster, box, &p, live, &job), hits, first, count);
}
)

#endif

/* ---- shades: what shading of rt.h needs to know on a device --------------------------------------------------------- */

#if RTI_IN(SHADES)

"#ifndef NULL\n"
"#define NULL 0\n"
"#endif\n"
"#define sqrtf sqrt\n"
"#define fabsf fabs\n"
"#define floorf floor\n"
"#define copysignf copysign\n"
"#define rti_keepf(x) (x)\n"
"#define rti_double_bits as_ulong\n"
"#define rti_bits_double as_double\n"
"#define rti_vsqrt sqrt\n"
"#define RTI_ABREAST 1\n"
"#define RTI_SHOWS(things) RTI_SHOWS_##things\n"
"#define RTI_FOLLOW(type, from, field) "
    "((from)->field ? (const __global type *)((const __global char *)(from) + (from)->field) : (const __global type *)0)\n"
"#define rt_texture rti_gpu_texture\n"
"#define rt_material rti_gpu_material\n"
"#define rt_light rti_gpu_light\n"
"#define rti_part rti_gpu_shape\n"
"#define rti_shape_of(p) ((rti_shape){ .vertices = RTI_FOLLOW(float, p, vertices), .stride = (p)->stride, "
    ".indices = RTI_FOLLOW(uint32_t, p, indices), .normals = RTI_FOLLOW(rt_vec3, p, normals), "
    ".normal_indices = RTI_FOLLOW(uint32_t, p, normal_indices), .colors = RTI_FOLLOW(rt_vec3, p, colors), "
    ".texcoords = RTI_FOLLOW(float, p, texcoords), .texcoord_indices = RTI_FOLLOW(uint32_t, p, texcoord_indices), "
    ".materials = RTI_FOLLOW(rt_material, p, materials), .material_ids = RTI_FOLLOW(uint32_t, p, material_ids), "
    ".triangle_count = (p)->triangle_count, .instance_count = (p)->instance_count, "
#if RTI_SPHERES
    ".spheres = RTI_FOLLOW(rt_sphere, p, spheres), "
#endif
#if RTI_PLANES
    ".planes = RTI_FOLLOW(rt_plane, p, planes), "
#endif
    ".tree_count = (p)->tree_count })\n"
#if RTI_INSTANCES
"#define rti_family_of(accel) ((rti_family){ (const __global uint32_t *)rti_reach((accel)->arena, (accel)->record->instance_bases), "
    "(const __global uint32_t *)rti_reach((accel)->arena, (accel)->record->instance_slots), (accel)->instances, "
    "(accel)->record->instance_count, (accel)->record->paths })\n"
#endif
#if RTI_SAMPLING
"#define RTI_SAMPLING_OR(with, without) (with)\n"
#else
"#define RTI_SAMPLING_OR(with, without) (without)\n"
#endif

RTI_SHARED(
typedef int rt_texture_kind;
typedef int rt_sampler_kind;
typedef int rt_filter;
typedef struct { rt_sampler_kind kind; uint32_t spp, seed, frame; } rt_sampler;
typedef struct { rt_vec3 center; float radius; } rt_sphere;
typedef struct { rt_vec3 point, normal; float radius; } rt_plane;

RTI_FN const RTI_GLOBAL rti_part *rti_part_of(const RTI_GLOBAL rti_part *part, uint32_t number)
{
    const RTI_GLOBAL int64_t *distance = RTI_FOLLOW(int64_t, part, parts) + number;
    return (const RTI_GLOBAL rti_part *)((const RTI_GLOBAL char *)distance + *distance);
}
)

#endif

/* ---- frame: what a ray does in a picture ---------------------------------------------------------------------------- */

#if RTI_IN(FRAME)

/* A surface that a ray has met, its lanes as rti_lane of rt.h says; material NULL: none. share: what a light's point counts. */
RTI_SHARED(
typedef struct {
    float lanes[RTI_LANE_COUNT], share;
    rt_vec3 tint;
    const RTI_GLOBAL rt_material *material;
    bool inside;
} rti_surface;

RTI_FN void rti_make_film(const rti_gpu_frame *frame, rti_film *film)
{
    film->view.eye = frame->view[0];
    film->view.corner = frame->view[1];
    film->view.right = frame->view[2];
    film->view.down = frame->view[3];
    film->left = frame->left;
    film->top = frame->top;
    film->side = frame->width;
)
#if RTI_SAMPLING
RTI_SHARED(
    film->sampler.kind = RTI_SAMPLER_KIND;
    film->sampler.spp = frame->spp;
    film->sampler.seed = frame->seed;
    film->sampler.frame = frame->frame;
    film->sample = frame->sample;
    film->filter = RTI_FILTER_KIND;
    film->lens.right = frame->lens_right;
    film->lens.down = frame->lens_down;
    film->lens.rfocus = frame->rfocus;
    film->lens.open = RTI_LENS_OPEN;
    film->spread = RTI_SPREAD;
    film->timed = RTI_TIMED;
    film->open = frame->open;
    film->length = frame->length;
    film->light_pairs = frame->light_pairs;
)
#endif
RTI_SHARED(
}
)

/* root: room for the outermost accel, if there are instances to follow. */
RTI_SHARED(
RTI_FN void rti_make_world(const rti_gpu_frame *frame, const RTI_GLOBAL char *scene, const RTI_GLOBAL char *arena, rt_accel *root,
                           rti_world *world)
{
    const RTI_GLOBAL rti_part *part = (const RTI_GLOBAL rti_part *)scene;
    world->shape = rti_shape_of(part);
    world->ambient = frame->ambient;
    world->background = frame->background;
    world->angle = frame->angle;
)
#if RTI_INSTANCES
RTI_SHARED(
    if (RTI_SHOWS(INSTANCES)) rti_open(root, arena, 0);
    world->accel = root;
    world->part = part;
)
#endif
RTI_SHARED(
}
)

RTI_SHARED(
RTI_FN void rti_start(const rti_gpu_frame *frame, const rti_film *film, uint32_t pixel, rti_path *path, rt_ray *ray)
{
    const float x = (float)(film->left + pixel % film->side) + frame->dx, y = (float)(film->top + pixel / film->side) + frame->dy;
    *ray = rti_view_ray(&film->view, x, y);
    rti_start_path(path, pixel, frame->open);
)
#if RTI_SAMPLING
RTI_SHARED(
    rti_spread(film, path, ray);
)
#endif
RTI_SHARED(
}

RTI_FN void rti_see_hit(const rti_world *world, const rt_ray *ray, const rt_hit *hit, rti_path *path, rti_surface *s, rt_vec3 *sum)
{
    rti_known known = { NULL, false, false };
    s->inside = false;
    if (hit->prim == RT_NONE) rti_add_to(sum, path->weight, world->background);
    else {
        rti_meet(world, ray, hit, path, &known, s->lanes, &s->tint, &s->inside, sum);
        rti_finish_lanes(s->lanes);
    }
    s->material = known.material;
}
)

/* The ray from a surface to a light; false: the light does nothing there. */
RTI_SHARED(
RTI_FN bool rti_aim_at(const rti_film *film, const rti_path *path, const rt_light *light, uint32_t number, rti_surface *s, rt_ray *ray)
{
    rti_v there[3];
    there[0] = light->position.x;
    there[1] = light->position.y;
    there[2] = light->position.z;
    s->share = 1;
)
#if RTI_SAMPLING
RTI_SHARED(
    if (RTI_SHOWS(LAMPS) && rti_has_size(light)) {
        s->share = rti_sample_light(film, path, light, number, s->lanes);
        rti_vload3(s->lanes, RTI_TO_LIGHT, there);
    }
)
#endif
RTI_SHARED(
    rti_aim_lanes(s->lanes, there);
    rti_set_ray(ray, rti_get(s->lanes, RTI_POINT), rti_get(s->lanes, RTI_TO_LIGHT), 1);
    return rti_faces_light(s->lanes, s->tint, s->material) && s->share > 0;
}

RTI_FN void rti_add_light(const rt_light *light, rt_vec3 weight, const rti_surface *s, rt_vec3 *sum)
{
    rt_vec3 color = light->color;
)
#if RTI_SAMPLING
RTI_SHARED(
    if (RTI_SHOWS(LAMPS) && rti_has_size(light)) color = rti_scale(color, s->share);
)
#endif
RTI_SHARED(
    rti_shine(s->lanes, s->tint, weight, s->material, color, sum);
}
)

/* As rti_bounce_off, if there is a shiny surface and its ray is not the last. */
RTI_SHARED(
RTI_FN uint32_t rti_send_on(const rti_film *film, const rti_path *path, const rti_surface *s, bool last, rt_ray rays[2], rti_path paths[2])
{
    rt_ray *const to_rays[2] = { &rays[0], &rays[1] };
    rti_path *const to_paths[2] = { &paths[0], &paths[1] };
    if (last || !s->material || !(rti_any(s->material->reflect) || rti_any(s->material->transmit))) return 0;
    return rti_bounce_off(film, path, s->material, s->inside, s->lanes, to_rays, to_paths);
}

RTI_FN rt_light rti_light_of(const RTI_GLOBAL char *scene, const rti_gpu_frame *frame, uint32_t number)
{
    return ((const RTI_GLOBAL rt_light *)(scene + (size_t)frame->lights * RTI_GPU_ALIGN))[number];
}
)

#endif

/* ---- steps: pictures, a sample of all pixels of a tile at a time ---------------------------------------------------- */

/* look starts the eye rays, number 0 those of the pixels' first samples; then, until no ray is left, rays are traced by the kernels of batches,
   meet finds the surfaces, aim sends shadow rays to a light, which are traced, shine adds what the light does; bounce sends on what is mirrored
   or refracted. A pixel has one ray on its way, the others wait: so its sum has the order that it has in rt.h. */
#if RTI_IN(STEPS)

/* The memory of a tile: its pixels, the paths of the rays before and after a bounce, what is known of the surfaces they are on, number by
   number, what waits, place by place, and which pixels get rays, if not all do. */
RTI_SHARED(
typedef struct {
    RTI_GLOBAL uint32_t *count;             /* rays after a bounce */
    RTI_GLOBAL rti_gpu_pixel *pixels;
    RTI_GLOBAL rti_gpu_path *paths[2];
    RTI_GLOBAL float *surfaces;
    RTI_GLOBAL rt_ray *waiting_rays;
    RTI_GLOBAL rti_gpu_path *waiting;
    RTI_GLOBAL uint32_t *chosen;
} rti_work;

RTI_FN void rti_make_work(RTI_GLOBAL char *memory, const rti_gpu_frame *frame, rti_work *w)
{
    const size_t space = frame->space;
    w->count = (RTI_GLOBAL uint32_t *)memory;
    w->pixels = (RTI_GLOBAL rti_gpu_pixel *)(memory + RTI_GPU_ALIGN);
    w->paths[0] = (RTI_GLOBAL rti_gpu_path *)(w->pixels + space);
    w->paths[1] = w->paths[0] + space;
    w->surfaces = (RTI_GLOBAL float *)(w->paths[1] + space);
    w->waiting_rays = (RTI_GLOBAL rt_ray *)(w->surfaces + RTI_GPU_SURFACE * space);
    w->waiting = (RTI_GLOBAL rti_gpu_path *)(w->waiting_rays + frame->waiting * space);
    w->chosen = (RTI_GLOBAL uint32_t *)(w->waiting + frame->waiting * space);
}
)

/* Where the numbers of a surface stand that are not lanes. */
RTI_SHARED(
enum { RTI_TINT = RTI_LANE_COUNT, RTI_SHARE = RTI_TINT + 3, RTI_MATERIAL, RTI_INSIDE, RTI_SURFACE_NUMBERS };
typedef char rti_check_surface[RTI_SURFACE_NUMBERS == RTI_GPU_SURFACE ? 1 : -1];

RTI_FN uint32_t rti_number_of(const RTI_GLOBAL char *scene, const RTI_GLOBAL rt_material *material)
{
    return material ? (uint32_t)(((const RTI_GLOBAL char *)material - scene) / 16) : 0;
}

RTI_FN const RTI_GLOBAL rt_material *rti_material_of(const RTI_GLOBAL char *scene, uint32_t number)
{
    return number ? (const RTI_GLOBAL rt_material *)(scene + (size_t)number * 16) : (const RTI_GLOBAL rt_material *)0;
}
)

RTI_SHARED(
RTI_FN void rti_load_path(const RTI_GLOBAL char *scene, const RTI_GLOBAL rti_gpu_path *from, rti_path *path)
{
    path->weight = from->weight;
    path->pixel = from->pixel;
    path->medium = rti_material_of(scene, from->medium);
    path->width = from->width;
)
#if RTI_SAMPLING
RTI_SHARED(
    path->time = from->time;
    path->branch = from->branch;
)
#endif
RTI_SHARED(
}

RTI_FN void rti_save_path(const RTI_GLOBAL char *scene, const rti_path *path, uint32_t level, RTI_GLOBAL rti_gpu_path *to)
{
    to->weight = path->weight;
    to->pixel = path->pixel;
    to->medium = rti_number_of(scene, path->medium);
    to->level = level;
    to->width = path->width;
    to->time = RTI_SAMPLING_OR(path->time, 0);
    to->branch = RTI_SAMPLING_OR(path->branch, 0);
}
)

/* As meet leaves it: without what aim adds. */
RTI_SHARED(
RTI_FN void rti_save_surface(const RTI_GLOBAL char *scene, const rti_surface *s, size_t space, RTI_GLOBAL float *to)
{
    int k;
    to[RTI_MATERIAL * space] = as_float(rti_number_of(scene, s->material));
    if (!s->material) return;
    RTI_UNROLL
    for (k = 0; k <= RTI_OFFSET; k++) to[k * space] = s->lanes[k];
    to[RTI_TINT * space] = s->tint.x;
    to[(RTI_TINT + 1) * space] = s->tint.y;
    to[(RTI_TINT + 2) * space] = s->tint.z;
    to[RTI_INSIDE * space] = s->inside;
}

RTI_FN void rti_load_surface(const RTI_GLOBAL char *scene, const RTI_GLOBAL float *from, size_t space, rti_surface *s)
{
    int k;
    s->material = rti_material_of(scene, as_uint(from[RTI_MATERIAL * space]));
    if (!s->material) return;
    RTI_UNROLL
    for (k = 0; k <= RTI_OFFSET; k++) s->lanes[k] = from[k * space];
    s->tint = rti_vec3(from[RTI_TINT * space], from[(RTI_TINT + 1) * space], from[(RTI_TINT + 2) * space]);
    s->inside = from[RTI_INSIDE * space] != 0;
}
)

"#define RTI_STEP __global const char *scene, __global const char *arena, rti_gpu_frame given, __global char *memory, __global rt_ray *rays, "
    "__global rt_hit *hits, __global float *times, uint count, uint turn, uint number\n"

RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_look(RTI_STEP)
{
    const rti_gpu_frame *const frame = &given;
    const uint32_t i = (uint32_t)get_global_id(0);
    rti_work w;
    rti_film film;
    rti_path path;
    rt_ray ray;
    if (i >= count) return;
    rti_make_work(memory, frame, &w);
    rti_make_film(frame, &film);
    rti_start(frame, &film, frame->chosen ? w.chosen[i] : rti_place_of(i, frame->width, frame->height), &path, &ray);
    rays[i] = ray;
    if (RTI_TIMED) times[i] = RTI_SAMPLING_OR(path.time, 0);
    rti_save_path(scene, &path, 0, &w.paths[0][i]);
    if (!number) w.pixels[path.pixel] = (rti_gpu_pixel){ { 0, 0, 0 }, 0, 0, 0, 0 };
}
)

RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_meet(RTI_STEP)
{
    const rti_gpu_frame *const frame = &given;
    const uint32_t i = (uint32_t)get_global_id(0);
    rti_work w;
    RTI_GLOBAL rti_gpu_path *saved;
    rti_surface surface;
    rti_world world;
    rti_path path;
    rt_accel root;
    rt_vec3 sum;
    rt_hit hit;
    rt_ray ray;
    rti_make_work(memory, frame, &w);
    if (!i) *w.count = 0;
    if (i >= count) return;
    saved = &w.paths[turn][i];
    ray = rays[i];
    hit = hits[i];
    rti_load_path(scene, saved, &path);
    sum = w.pixels[path.pixel].sum;
    rti_make_world(frame, scene, arena, &root, &world);
    rti_see_hit(&world, &ray, &hit, &path, &surface, &sum);
    rti_save_surface(scene, &surface, frame->space, w.surfaces + i);
    rti_save_path(scene, &path, saved->level, saved);
    w.pixels[path.pixel].sum = sum;
}
)

/* Where a light does nothing a ray goes nowhere: its hit is none, and the surface's cosine 0. */
RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_aim(RTI_STEP)
{
    const rti_gpu_frame *const frame = &given;
    const uint32_t i = (uint32_t)get_global_id(0);
    rti_work w;
    const rt_light light = rti_light_of(scene, frame, number);
    const size_t space = frame->space;
    RTI_GLOBAL float *to;
    rti_surface surface;
    rt_ray ray;
    bool sent = false;
    if (i >= count) return;
    rti_make_work(memory, frame, &w);
    to = w.surfaces + i;
    rti_load_surface(scene, to, space, &surface);
    if (surface.material) {
        rti_film film;
        rti_path path;
        rti_make_film(frame, &film);
        rti_load_path(scene, &w.paths[turn][i], &path);
        sent = rti_aim_at(&film, &path, &light, number, &surface, &ray);
        to[RTI_COSINE * space] = sent ? surface.lanes[RTI_COSINE] : 0;
        to[RTI_HIGHLIGHT * space] = surface.lanes[RTI_HIGHLIGHT];
        to[RTI_SHARE * space] = surface.share;
        w.pixels[path.pixel].shadow += sent;
    }
    if (!sent) rti_set_ray(&ray, rti_vec3(0, 0, 0), rti_vec3(0, 0, 1), -1);
    rays[i] = ray;
}
)

RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_shine(RTI_STEP)
{
    const rti_gpu_frame *const frame = &given;
    const uint32_t i = (uint32_t)get_global_id(0);
    rti_work w;
    const rt_light light = rti_light_of(scene, frame, number);
    const size_t space = frame->space;
    const RTI_GLOBAL float *from;
    RTI_GLOBAL rti_gpu_pixel *pixel;
    rti_surface surface;
    rt_vec3 sum;
    if (i >= count || hits[i].prim != RT_NONE) return;
    rti_make_work(memory, frame, &w);
    from = w.surfaces + i;
    rti_load_surface(scene, from, space, &surface);
    if (!surface.material) return;
    surface.lanes[RTI_COSINE] = from[RTI_COSINE * space];
    if (!(surface.lanes[RTI_COSINE] > 0)) return;
    surface.lanes[RTI_HIGHLIGHT] = from[RTI_HIGHLIGHT * space];
    surface.share = from[RTI_SHARE * space];
    pixel = &w.pixels[w.paths[turn][i].pixel];
    sum = pixel->sum;
    rti_add_light(&light, w.paths[turn][i].weight, &surface, &sum);
    pixel->sum = sum;
}
)

/* The ray that follows ray i of a pixel: what is refracted first, then what is mirrored, then what has been waiting; false: none. */
RTI_SHARED(
RTI_FN bool rti_go_on(const rti_work *w, const RTI_GLOBAL char *scene, const rti_gpu_frame *frame, uint32_t i, uint32_t turn, rt_ray *ray,
                      rti_path *path, uint32_t *level)
{
    const RTI_GLOBAL rti_gpu_path *const saved = &w->paths[turn][i];
    RTI_GLOBAL rti_gpu_pixel *const pixel = w->pixels + saved->pixel;
    uint32_t waiting = pixel->waiting;
    uint32_t sent;
    rti_film film;
    rti_path from;
    rti_surface surface;
    rt_ray rays[2];
    rti_path paths[2];
    size_t at;
    *level = saved->level + 1;
    rti_make_film(frame, &film);
    rti_load_path(scene, saved, &from);
    rti_load_surface(scene, w->surfaces + i, frame->space, &surface);
    sent = rti_send_on(&film, &from, &surface, saved->level >= frame->depth, rays, paths);
    pixel->reflect += sent & 1;
    pixel->refract += sent >> 1;
    if (sent == 3) {
        at = (size_t)waiting * frame->space + from.pixel;
        w->waiting_rays[at] = rays[0];
        rti_save_path(scene, &paths[0], *level, &w->waiting[at]);
        pixel->waiting = waiting + 1;
    }
    if (sent) {
        *ray = sent & 2 ? rays[1] : rays[0];
        *path = sent & 2 ? paths[1] : paths[0];
        return true;
    }
    if (!waiting) return false;
    pixel->waiting = --waiting;
    at = (size_t)waiting * frame->space + from.pixel;
    *ray = w->waiting_rays[at];
    rti_load_path(scene, &w->waiting[at], path);
    *level = w->waiting[at].level;
    return true;
}
)

/* Rays move together, a work-group's beside each other. */
RTI_SHARED(
__kernel RTI_GROUP void rt_gpu_bounce(RTI_STEP)
{
    __local uint32_t going;
    __local uint32_t first;
    const rti_gpu_frame *const frame = &given;
    const uint32_t i = (uint32_t)get_global_id(0);
    rti_work w;
    uint32_t place = 0;
    uint32_t level;
    rti_path path;
    rt_ray ray;
    bool goes = false;
    rti_make_work(memory, frame, &w);
    if (!get_local_id(0)) going = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (i < count) goes = rti_go_on(&w, scene, frame, i, turn, &ray, &path, &level);
    if (goes) place = atomic_inc(&going);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!get_local_id(0)) first = atomic_add(w.count, going);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (goes) {
        place += first;
        rays[place] = ray;
        rti_save_path(scene, &path, level, &w.paths[!turn][place]);
        if (RTI_TIMED) times[place] = RTI_SAMPLING_OR(path.time, 0);
    }
}
)

#endif
