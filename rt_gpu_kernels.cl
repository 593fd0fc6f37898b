/* rt_gpu_kernels.cl - what rt_gpu.h runs on devices, in OpenCL C 1.2.    SPDX-License-Identifier: MIT OR Unlicense

   rt_gpu.h includes this file a part at a time, RTI_SHARED making strings of what stands in it, as it includes rt.h for the traversals,
   primitive tests that both have in common: so programs carry their kernels, and need no file. A program is put together for one algorithm
   and one scene (rti_gpu_write_program in rt_gpu.h): definitions first, then parts, in the order of their numbers there.

   Instances are entered without recursion, which devices lack: all from INSTANCES to WALK stands in the program once a level of nesting,
   the innermost first, every name with the level's number (RTI_LEVEL_NAMES in rt_gpu.h). What no accel of a level has is left out.  */

/* ---- layout: the same as C and on the device ------------------------------------------------------------------------ */

#if RTI_IN(LAYOUT)

/* An accel as it is uploaded; arrays are given in units of RTI_GPU_ALIGN bytes from where all accels start. */
RTI_SHARED(
typedef struct {
    uint32_t structure, node_count, plane_count, moves, bounds, orders, order_axes[3], slots[3];
    uint32_t nodes, kdnodes, kdlinks, kdslots, links, triangles, balls, planes, instances, wide;
    float lower[3], upper[3], extent, spread;
} rti_gpu_record;
typedef char rti_check_record[sizeof(rti_gpu_record) == 120 ? 1 : -1];
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

/* A node of RT_BVH_WIDE: 8 children, by coordinate. A child is an inner node, its count 0, or a leaf as in rti_node; where there is none,
   index is 0 too, and its box infinitely far, which most rays miss. */
RTI_SHARED(
typedef struct { float bounds[6][8]; uint32_t index[8], count[8]; } rti_gpu_wide;
)

/* The same for GPUs, half of it: planes in steps of 2^exponent from an origin, rounded outwards. */
RTI_SHARED(
typedef struct { float origin[3]; signed char exponent[4]; uint8_t bounds[6][8]; uint32_t index[8], count[8]; } rti_gpu_compact;
typedef char rti_check_wide[sizeof(rti_gpu_wide) == 256 && sizeof(rti_gpu_compact) == 128 ? 1 : -1];
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
RTI_FN RTI_VECTOR(int) rti_spread(unsigned lanes)
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
RTI_FN rti_v rti_vselect(unsigned lanes, rti_v a, rti_v b) { return rti_spread(lanes) ? a : b; }
RTI_FN rti_d rti_dset(double x) { return (rti_d)(x); }
RTI_FN rti_d rti_dload(const double *p) { return RTI_VECTOR(vload)(0, p); }
RTI_FN void rti_dstore(double *p, rti_d a) { RTI_VECTOR(vstore)(a, 0, p); }
RTI_FN unsigned rti_dlt(rti_d a, rti_d b) { return RTI_VECTOR(rti_signs)(RTI_VECTOR(convert_int)(a < b)); }
RTI_FN rti_d rti_dselect(unsigned lanes, rti_d a, rti_d b) { return RTI_VECTOR(convert_long)(rti_spread(lanes)) ? a : b; }
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
RTI_FN float8 rti_planes8(const RTI_GLOBAL rti_gpu_wide *node, int plane, float org, float rdir)
{
    const float8 planes = vload8(0, node->bounds[plane]);
    if (RTI_FMA) return fma(planes, (float8)(rdir), (float8)(-org));
    return (planes - org) * rdir;
}
RTI_FN float8 rti_min8(float8 a, float8 b) { return a < b ? a : b; }
RTI_FN float8 rti_max8(float8 a, float8 b) { return a > b ? a : b; }
RTI_FN unsigned rti_hit_children(const rti_slabs *s, const RTI_GLOBAL rti_gpu_wide *node, float tmax, float *enter)
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
__kernel void rt_gpu_trace(__global const char *arena, __global const rt_ray *rays, __global rt_hit *hits, __global const float *times,
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
