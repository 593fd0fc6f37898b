#!/bin/sh
# make matrix: every compiler, standard, flag, opt-out and target. Prints a line a combination and ends with a failure where one fails, or
# lacks its compiler or emulator: nothing is skipped. sh tests/matrix.sh PART runs this of its parts, any beside another:
#   1 rt.h twice in one file and in two that link, warnings as errors, as C and C++
#   2 opt-outs alone, in pairs and as a user would have them together: warnings, code at -Os, public structs
#   3 rt_test: the same checksum of all hits from each compiler, optimisation and instruction set
#   4 the same on other processors and systems. TARGET=NAME: on those with such names
#   5 instructions that a scene does without, see tests/leave_out.sh
cd "$(dirname "$0")/.." || exit 1
case $1 in [1-5]) ;; *) echo "no part is called '$1'"; exit 1 ;; esac
dir=build/matrix/$1
mkdir -p $dir
warn="-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Werror"
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }

cat >$dir/one.c <<'END'
#include "rt.h"
#define RT_IMPLEMENTATION
#include "rt.h"
int other(void);
int main(void) { return other() != RT_HEADER_VERSION; }
END
cat >$dir/two.c <<'END'
#include "rt.h"
#include <string.h>
int other(void);
int other(void)
{
    rt_accel *accel;
    rt_geometry nothing;
    memset(&nothing, 0, sizeof nothing);
    if (rt_build(&accel, &nothing, 0) != RT_OK) return 0;
    rt_free(accel);
    return RT_HEADER_VERSION;
}
END
cat >$dir/static.c <<'END'
#define RT_STATIC
#define RT_IMPLEMENTATION
#include "rt.h"
int other(void);
int other(void) { return rt_status_string(RT_OK) ? RT_HEADER_VERSION : 0; }
END
cat >$dir/gpu.c <<'END'
#include "rt.h"
#include "rt_gpu.h"
#define RT_IMPLEMENTATION
#define RT_GPU_IMPLEMENTATION
#include "rt.h"
#include "rt_gpu.h"
#include "rt.h"
#include "rt_gpu.h"
int main(void) { rt_gpu *gpu = 0; rt_gpu_close(gpu); return 0; }
END

part_1() {
    echo "1. one include, two translation units"
    for compiler in "gcc -std=c99" "gcc -std=c11" "gcc -std=c17" "gcc -std=gnu17" "clang -std=c99" "clang -std=c11" "clang -std=c17" "clang -std=gnu17" \
                    "g++ -x c++ -std=c++11" "g++ -x c++ -std=c++20" "clang++ -x c++ -std=c++11" "clang++ -x c++ -std=c++20"; do
        before=$failures
        $compiler -O2 $warn -I. -c $dir/one.c -o $dir/one.o || fail "$compiler"
        $compiler -O0 $warn -I. -c $dir/gpu.c -o $dir/gpu.o || fail "$compiler (rt_gpu.h)"
        for second in two static; do
            $compiler -O2 $warn -I. -c $dir/$second.c -o $dir/$second.o || fail "$compiler ($second)"
            ${compiler% -x*} $dir/one.o $dir/$second.o -o $dir/linked -lm && $dir/linked || fail "$compiler (linked with $second)"
        done
        test $failures = $before && echo "  ok: $compiler"
    done
}

# code and constants at -Os, and bytes of the public structs that opt-outs make smaller
part_2() {
    echo "2. opt-outs: bytes of code and constants at -Os (gcc), and of public structs"
    cat >$dir/structs.c <<'END'
#include "rt.h"
#include <stdio.h>
int main(void)
{
    printf("%9lu %9lu", (unsigned long)sizeof(rt_geometry), (unsigned long)sizeof(rt_trace_options));
#ifndef RT_NO_SHADING
    printf("%9lu %9lu %9lu", (unsigned long)sizeof(rt_material), (unsigned long)sizeof(rt_light), (unsigned long)sizeof(rt_render_options));
#else
    printf("%9s %9s %9s", "-", "-", "-");
#endif
    return 0;
}
END
    printf '  %9s %9s %9s %9s %9s %9s %9s\n' code constants geometry trace material light render
    each="SIMD BVH KDTREE THREADED PACKETS SPHERES INSTANCES PLANES STATS SAMPLING SHADING"
    triangles="SPHERES INSTANCES PLANES STATS SAMPLING SHADING"
    {
        echo "everything:"
        for name in $each; do echo "RT_NO_$name: $name"; done
        echo "BVH only: KDTREE THREADED"
        echo "k-d tree only: BVH THREADED"
        echo "threaded only: BVH KDTREE"
        echo "BVH, single rays: KDTREE THREADED PACKETS"
        echo "no shading, no sampling: SHADING SAMPLING"
        echo "triangles, all structures: $triangles"
        echo "triangles, BVH: $triangles KDTREE THREADED"
        echo "triangles, k-d tree, single rays: $triangles BVH THREADED PACKETS"
        echo "triangles, threaded, single rays: $triangles BVH KDTREE PACKETS"
        echo "triangles, BVH, single rays: $triangles KDTREE THREADED PACKETS"
        echo "the same, RT_NO_SIMD: $triangles KDTREE THREADED PACKETS SIMD"
    } >$dir/builds
    while IFS=: read -r title names; do
        optout=
        for name in $names; do optout="$optout -DRT_NO_$name"; done
        for compiler in "clang -std=c99" "g++ -x c++ -std=c++11" "clang++ -x c++ -std=c++11"; do
            $compiler $warn $optout -I. -c $dir/gpu.c -o $dir/gpu.o || fail "$compiler $title"
        done
        gcc -std=c99 -Os $warn $optout -I. -c $dir/one.c -o $dir/optout.o || fail "gcc -Os $title"
        gcc -std=c99 $optout -I. $dir/structs.c -o $dir/structs || fail "structs of $title"
        sizes=$(size -A $dir/optout.o | awk '/^\.text/ { code += $2 } /^\.(ro)?data/ { data += $2 } END { printf "%9d %9d", code, data }')
        printf '  %s %s  %s\n' "$sizes" "$($dir/structs)" "$title"
        smallest=${sizes% *}
        test "$title" != "triangles, BVH, single rays" || test $smallest -lt 24576 || fail "the smallest useful library is not under 24 KiB"
    done <$dir/builds
    for first in $each; do                    # in pairs: what one leaves unused, another may leave undefined
        for second in $each; do
            clang -std=c99 -fsyntax-only $warn -DRT_NO_$first -DRT_NO_$second -I. $dir/gpu.c || fail "RT_NO_$first with RT_NO_$second"
            test $second != $first || break
        done
    done
    echo "  any two together compile without a warning"
    gcc -std=c99 -fsyntax-only -DRT_NO_BVH -DRT_NO_KDTREE -DRT_NO_THREADED -I. $dir/one.c 2>/dev/null && fail "no structure at all is no error"
}

# hits TITLE WANT ISA RUN...: runs an rt_test, which must choose this instruction set, pass, and print this checksum, which $sum has then.
# WANT and ISA may be empty: any.
hits() {
    title=$1 want=$2 isa=$3
    shift 3
    start=$(date +%s)
    "$@" </dev/null >$dir/raw 2>&1
    status=$?
    tr -d '\r' <$dir/raw >$dir/log            # with which Windows ends its lines
    sum=$(sed -n 's/^hits checksum: \(0x[0-9a-f]*\).*/\1/p' $dir/log)
    chosen=$(sed -n 's/^seed [0-9]*, \([a-z0-9]*\),.*/\1/p' $dir/log)
    printf '  %-64s %-6s %s, %s, %d s\n' "$title" "$chosen" "$sum" "$(tail -n 1 $dir/log)" $(($(date +%s) - start))
    test $status = 0 || { grep -v '^ok' $dir/log | tail -n 20; fail "$title"; }
    test "$chosen" = "${isa:-$chosen}" || fail "$title: runs $chosen instead of $isa"
    test -n "$sum" && test "$sum" = "${want:-$sum}" || fail "$title: the checksum is not ${want:-there}"
    sum=${want:-$sum}
}

# The tests of parts 3 and 4. All leave out gpu., the OpenCL of this machine, and programs., which start compilers and programs of this machine.
#   most  all others, less the longest, which are of no processor in particular: raster.ugly, raster.huge and kdtree.planes
#   few   where floats are emulated, 30 to 100 times slower: geometry of every kind and size, structures pinned to their bytes, samplers,
#         textures and all loaders; no pictures, and none of the tests with many random rays, of which
#   some  adds those of hits. and rays., and those with threads
most="--no-gpu --without programs. --without raster.ugly --without raster.huge --without kdtree.planes"
few="--no-gpu oracle status hits.empty hits.sphere-start hits.short ground.bad motion.turn motion.transform motion.bad motion.refit instances.tiny
     instances.bad instances.paths instances.transform rays.intervals rays.arrays refit.errors build.pinned build.layouts options
     textures.levels textures.check sampling.golden shading.math shading.camera loaders."
some="$few hits. rays. instances.deep watertight.grid build.parallel threads"

# C++ is read by part 1, and run by tests/dropin.sh.
part_3() {
    echo "3. the hits of rt_test"
    sum=
    native="-O3 -march=native -ffp-contract=fast"
    for compiler in gcc clang; do
        for flags in "-std=c99 -O0" "-std=c11 -O2" "-std=c17 $native" "-std=gnu17 $native" "-std=c99 -Os" "-std=c99 -O2 -DRT_NO_SIMD" \
                     "-std=gnu17 $native -DRT_NO_SIMD"; do
            $compiler $flags -I. tests/rt_test.c -o $dir/rt_test -lm -lpthread || { fail "$compiler $flags does not build"; continue; }
            case $flags in *NO_SIMD) isa=scalar ;; *) isa= ;; esac
            hits "$compiler $flags" "$sum" "$isa" $dir/rt_test --scale 8 $most
        done
    done
}

wasm="-pthread -sENVIRONMENT=node,worker -sPROXY_TO_PTHREAD -sPTHREAD_POOL_SIZE=10 -sEXIT_RUNTIME -sSINGLE_FILE -sINITIAL_MEMORY=1GB"
# Debian's emscripten looks for its modules where only Debian's node does
export NODE_PATH="${NODE_PATH:-/usr/share/nodejs}" WINEPREFIX="$PWD/$dir/wine" WINEDEBUG=-all

# name | compiler | what it makes | what runs that | instruction set, where it is certain | tests
# i686 is gcc -m32 under another name: Debian's gcc-multilib cannot be installed beside a cross compiler. Its own loader finds its libc.
targets="
sse2    | gcc                                    | rt_test     | qemu-x86_64 -cpu Nehalem                                                        | sse2   | some
i686    | i686-linux-gnu-gcc -msse2 -mfpmath=sse | rt_test     | /usr/i686-linux-gnu/lib/ld-linux.so.2 --library-path /usr/i686-linux-gnu/lib    |        | most
aarch64 | aarch64-linux-gnu-gcc                  | rt_test     | qemu-aarch64 -L /usr/aarch64-linux-gnu                                          | scalar | some
s390x   | s390x-linux-gnu-gcc                    | rt_test     | qemu-s390x -L /usr/s390x-linux-gnu                                              | scalar | few
windows | x86_64-w64-mingw32-gcc-posix -static   | rt_test.exe | wine                                                                            | sse2   | most
wasm    | emcc $wasm                             | rt_test.js  | node                                                                            | scalar | some
"

part_4() {
    echo "4. the hits of rt_test on other processors and systems"
    build="-std=gnu99 -O2 -w -I. tests/rt_test.c"
    gcc $build -o $dir/here -lm -lpthread || fail "here"
    echo "$targets" | grep . >$dir/targets
    while IFS='|' read -r name compiler program runner isa tests; do
        name=$(echo $name) tests=$(echo $tests) program=$dir/$(echo $program)
        case " ${TARGET:-$name} " in *" $name "*) ;; *) continue ;; esac
        eval sum=\$sum_$tests selection=\$$tests
        test -n "$sum" || hits "here: the $tests" "" "" $dir/here --scale 8 $selection
        eval sum_$tests=$sum
        for file in one gpu; do               # emcc would refuse what is for its linker
            $compiler -std=gnu99 -O1 $warn -Wno-unused-command-line-argument -I. -c $dir/$file.c -o $dir/$file.o || fail "$name: $file.c"
        done
        rm -f $program
        $compiler $build -o $program -lm -lpthread || { fail "$name: rt_test does not build"; continue; }
        hits "$name: the $tests" "$sum" "$(echo $isa)" $runner $program --scale 8 $selection
    done <$dir/targets
    test -n "$sum_most$sum_some$sum_few" || fail "no target is called $TARGET"
}

part_5() {
    sh tests/leave_out.sh >$dir/log 2>&1 || fail "leave_out.sh"
    sed -e 's/^\([0-9]\)\. /5.\1 /' $dir/log
}

part_$1
test $failures = 0
