#!/bin/sh
# tests/gpu.sh [SCENE [option of bench]...]: builds bench and render and measures all kernels of rt_gpu.h on this machine's OpenCL device, in
# under 8 minutes: which hits they find and pictures they draw, bit for bit, and how fast. SCENE: as bench has it, default hall:250000; options: --device, --eye, --look ...
#   needs     a C compiler; libOpenCL and a driver for the device. make is not needed
#   SIZES     default "1024x1024 4096x4096": one table of all rays at the first size, one for each kind of rays at the others
#   CHECK     default 256x256: rays of the correctness pass
#   REPEAT    default 20: measured rounds
#   BUDGET    default 460: seconds in all; what does not fit is cut off or left out, and named at the end
cd "$(dirname "$0")/.." || exit 1
SIZES=${SIZES:-1024x1024 4096x4096} CHECK=${CHECK:-256x256} REPEAT=${REPEAT:-20} BUDGET=${BUDGET:-460}
CC=${CC:-$(command -v cc || command -v gcc || command -v clang)}
start=$(date +%s)
bench=build/gpu/bench
troubles= before=
scene=${1:-hall:250000}
[ $# -gt 0 ] && shift
for option in "$@"; do
    [ "$before" = --device ] && export RT_GPU_DEVICE="$option"     # of render too
    before=$option
done

left() { echo $((BUDGET - $(date +%s) + start)); }
trouble() { troubles="$troubles
  $*"; }

# step LIMIT NAME COMMAND...: runs it for LIMIT seconds at most, and for what is left
step() {
    limit=$1 name=$2
    shift 2
    [ "$limit" -gt "$(left)" ] && limit=$(left)
    if [ "$limit" -lt 3 ]; then trouble "$name: left out, no time"; return 1; fi
    if command -v timeout >/dev/null; then timeout "$limit" "$@"; else "$@"; fi
    rc=$?
    [ $rc = 0 ] && return 0
    if [ $rc = 124 ]; then trouble "$name: cut off after $limit s"; else trouble "$name: exit status $rc"; fi
    return 1
}

title() { printf '\n==== %s (%s s so far)\n' "$*" $(($(date +%s) - start)); }

title build
[ -n "$CC" ] || { echo "gpu.sh: no C compiler: install gcc or clang, or set CC"; exit 1; }
command -v timeout >/dev/null || echo "there is no command timeout: steps run as long as they take"
mkdir -p build/gpu
"$CC" -std=c99 -O2 -I. -o $bench tests/bench.c -lm -lpthread -ldl || { echo "gpu.sh: $CC cannot build tests/bench.c"; exit 1; }
"$CC" --version | head -1

title devices
$bench --devices || { cat <<'NONE'
gpu.sh: no OpenCL device. It takes
  libOpenCL.so.1, the loader      Debian, Ubuntu: ocl-icd-libopencl1; Fedora: ocl-icd; or RT_GPU_LIBRARY=/path/of/it
  a driver in /etc/OpenCL/vendors NVIDIA's comes with its driver (nvidia-opencl-icd); AMD: rocm-opencl-icd or mesa-opencl-icd (rusticl);
                                  Intel: intel-opencl-icd; any CPU: pocl-opencl-icd
NONE
exit 1; }
nvidia-smi --query-gpu=name,driver_version,clocks.sm,clocks.mem,power.limit --format=csv,noheader 2>/dev/null

first=${SIZES%% *}
title "every algorithm at $first; compiled anew"
step 120 "table at $first" $bench --gpu --scene "$scene" --size "$first" --repeat "$REPEAT" "$@"

title "correctness: every packet width, every kind of ray, $CHECK, bit for bit"
for algorithm in bvh.stack bvh.wide bvh.simd bvh.masked bvh.ranged bvh.partition bvh.masked/both bvh.ranged/both bvh.partition/both kd.stack \
                 kd.restart kd.pushdown kd.shortstack kd.backtrack threaded.single threaded.parallel; do
    cull=none
    case $algorithm in */*) cull=${algorithm#*/} ;; esac
    if step 60 "correctness of $algorithm" $bench --gpu --cached --scene "$scene" --size "$CHECK" --repeat 1 --algorithm "${algorithm%/*}" \
            --cull $cull --packet all --json "$@" >build/gpu/check.json
    then
        problems=$(grep -o '"problem":"[^}]*' build/gpu/check.json | sort -u)
        if [ -n "$problems" ]; then echo "  $algorithm: $problems"; trouble "$algorithm has no numbers: $problems"
        else echo "  $algorithm: the same hits"; fi
    else
        echo "  $algorithm: FAILED"
        grep -o '"packet":.*"problem":"[^}]*' build/gpu/check.json | head -3
    fi
done

title "pictures: render --gpu beside render; seconds"
"$CC" -std=c99 -O2 -I. -o build/gpu/render examples/render.c -lm -lpthread -ldl || trouble "render: $CC cannot build it"
for picture in "hall:250000" "hall:250000 --primary raster" "mirrors:4" "glass:3 --depth 8" "textures" \
               "balls:4 --spp 16 --lens 0.06 --light-radius 0.5 --roughness 0.1"; do
    for way in "" --gpu; do
        # shellcheck disable=SC2086
        [ -x build/gpu/render ] && step 40 "picture $picture" build/gpu/render $picture --size 1024x1024 $way -o "build/gpu/picture$way.ppm" \
            >build/gpu/picture.txt && sed -n "s|^speed|  $picture $way:|p" build/gpu/picture.txt
    done
    cmp build/gpu/picture.ppm build/gpu/picture--gpu.ppm || trouble "picture $picture: another one"
done

title "Horn et al., Table 2: restart < packets < push-down < short-stack, at $first"
step 60 "order of Horn et al." $bench --gpu --cached --scene "$scene" --size "$first" --repeat "$REPEAT" --rays primary,shadow \
    --algorithm kd.restart,kd.pushdown,kd.shortstack,kd.stack --packet all "$@"

title "large packets, culled, at $first"
step 60 "large packets" $bench --gpu --cached --scene "$scene" --size "$first" --repeat "$REPEAT" \
    --algorithm bvh.masked,bvh.ranged,bvh.partition --packet all --cull both "$@"

title "programs for the scene and general ones, at $first"
for algorithm in bvh.wide bvh.stack kd.shortstack threaded.single; do
    step 40 "general $algorithm" $bench --compare --cached --scene "$scene" --size "$first" --repeat "$REPEAT" --algorithm $algorithm "$@"
done

for size in $SIZES; do
    [ "$size" = "$first" ] && continue
    for kind in primary shadow diffuse reflect; do
        title "every algorithm at $size, $kind"
        step 60 "$kind at $size" $bench --gpu --cached --scene "$scene" --size "$size" --repeat "$REPEAT" --rays $kind "$@"
    done
done

printf '\n==== %s s in all%s\n' $(($(date +%s) - start)) "${troubles:+; what went wrong:}"
[ -z "$troubles" ] || { echo "$troubles"; exit 1; }
