#!/bin/sh
# make matrix: every compiler, standard, flag and opt-out at hand. Prints a line a combination and ends with a failure where one fails.
#   1 rt.h twice in one file and in two that link, warnings as errors, as C and C++
#   2 each opt-out alone and all together: warnings, and code and constant bytes at -Os
#   3 rt_test: the same checksum of all hits from each compiler, optimisation and instruction set
cd "$(dirname "$0")/.." || exit 1
dir=build/matrix
mkdir -p $dir
warn="-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror"
failed=0
fail() { echo "FAILED: $*"; failed=1; }

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
printf '#include <stdlib.h>\nint main(void) { return 0; }\n' >$dir/probe.c
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

echo "1. one include, two translation units"
for compiler in "gcc -std=c99" "gcc -std=c11" "gcc -std=c17" "gcc -std=gnu17" "clang -std=c99" "clang -std=c17" \
                "g++ -x c++ -std=c++11" "g++ -x c++ -std=c++20" "clang++ -x c++ -std=c++11" "clang++ -x c++ -std=c++20" \
                "gcc -m32 -std=c99 -msse2 -mfpmath=sse"; do
    if ! $compiler $dir/probe.c -o $dir/linked 2>/dev/null; then
        echo "  not here: $compiler"
        continue
    fi
    $compiler -O2 $warn -I. -c $dir/one.c -o $dir/one.o || fail "$compiler"
    $compiler -O0 $warn -I. -c $dir/gpu.c -o $dir/gpu.o || fail "$compiler (rt_gpu.h)"
    for second in two static; do
        $compiler -O2 $warn -I. -c $dir/$second.c -o $dir/$second.o || fail "$compiler ($second)"
        ${compiler% -x*} $dir/one.o $dir/$second.o -o $dir/linked -lm && $dir/linked || fail "$compiler (linked with $second)"
    done
    echo "  ok: $compiler"
done

echo "2. opt-outs, bytes of code and constants at -Os (gcc)"
all="-DRT_NO_KDTREE -DRT_NO_THREADED -DRT_NO_SPHERES -DRT_NO_INSTANCES -DRT_NO_PLANES -DRT_NO_PACKETS -DRT_NO_STATS -DRT_NO_SAMPLING -DRT_NO_SHADING"
for optout in "" -DRT_NO_SIMD -DRT_NO_KDTREE -DRT_NO_THREADED -DRT_NO_SPHERES -DRT_NO_INSTANCES -DRT_NO_PLANES -DRT_NO_PACKETS -DRT_NO_STATS -DRT_NO_SAMPLING \
              -DRT_NO_SHADING "$all" "$all -DRT_NO_SIMD"; do
    for compiler in "gcc -std=c99" "clang -std=c99" "g++ -x c++ -std=c++11" "clang++ -x c++ -std=c++11"; do
        $compiler -O2 $warn $optout -I. -c $dir/one.c -o $dir/optout.o || fail "$compiler $optout"
        $compiler -O0 $warn $optout -I. -c $dir/gpu.c -o $dir/gpu.o || fail "$compiler $optout (rt_gpu.h)"
    done
    gcc -std=c99 -Os $optout -I. -c $dir/one.c -o $dir/optout.o || fail "-Os $optout"
    printf '  %7d  %s\n' "$(size $dir/optout.o | awk 'NR == 2 { print $1 + $2 }')" "${optout:-everything}"
done

echo "3. the hits of rt_test"
sum=
for compiler in gcc clang; do
    for flags in -O0 -O2 "-O3 -march=native -ffp-contract=fast"; do
        for simd in "" -DRT_NO_SIMD; do
            if ! $compiler -std=gnu99 $flags $simd -I. tests/rt_test.c -o $dir/rt_test -lm -lpthread; then
                fail "$compiler $flags $simd does not build"
                continue
            fi
            $dir/rt_test --no-gpu >$dir/log 2>&1 || { grep -E '^FAIL' $dir/log; fail "$compiler $flags $simd"; }
            got=$(grep -o 'checksum: 0x[0-9a-f]*' $dir/log)
            printf '  %-48s %s, %s\n' "$compiler $flags $simd" "$got" "$(tail -n 1 $dir/log)"
            test -n "$got" && test "$got" = "${sum:=$got}" || fail "the checksum differs from the first"
        done
    done
done
exit $failed
