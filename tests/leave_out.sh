#!/bin/sh
# What a scene does not have costs nothing: instructions, counted by callgrind, so that a run of the same program counts the same again. Fails
# where that is not so.
#   1 triangles alone, in the whole library and in one compiled without all that they do not need: within 1 %
#   2 what each thing costs that may be beside them, though no ray meets it: so much its absence saves
#   3 the same of pictures, with the random numbers drawn and the rays traced
cd "$(dirname "$0")/.." || exit 1
dir=build/leave_out
mkdir -p $dir
failed=0
fail() { echo "FAILED: $*"; failed=1; }
# count PROGRAM CASE...: its instructions to $n, what it prints to $dir/said
count()
{
    valgrind --tool=callgrind --toggle-collect=measured --compress-strings=no --callgrind-out-file=$dir/out "$@" >$dir/said 2>$dir/told || fail "$*"
    n=$(awk '/Collected/ { print $NF }' $dir/told)
    test -s $dir/said && test "${n:-0}" -gt 0 || fail "$*: nothing is counted"
}
calls() { awk -v name="$1" '/^cfn=/ { it = $0 ~ "cfn=" name "$" } /^calls=/ && it { split($1, n, "="); sum += n[2]; it = 0 } END { print sum + 0 }' $dir/out; }

only="-DRT_NO_SPHERES -DRT_NO_INSTANCES -DRT_NO_PLANES -DRT_NO_STATS -DRT_NO_SAMPLING -DRT_NO_SHADING"
compile() { ${CC:-cc} -std=c99 $2 tests/leave_out.c -o $dir/$1 -lm || fail "$1 does not compile"; }
compile whole -O2
compile bvh "-O2 $only -DRT_NO_KDTREE -DRT_NO_THREADED"
compile kdtree "-O2 $only -DRT_NO_BVH -DRT_NO_THREADED"
compile threaded "-O2 $only -DRT_NO_BVH -DRT_NO_KDTREE"
compile calls "-O1 -fno-inline"

echo "1. triangles alone: instructions of the whole library, and of one without the rest"
for case in "bvh build" "bvh rt_intersect" "bvh rt_occluded" "bvh bvh.stack" "bvh bvh.wide" "bvh bvh.wide:16" "bvh bvh.simd" "bvh bvh.masked" \
            "bvh bvh.ranged" "bvh bvh.partition" "kdtree build" "kdtree rt_intersect" "kdtree kd.stack:1" "kdtree kd.stack" "kdtree kd.restart" \
            "kdtree kd.pushdown" "kdtree kd.shortstack" "kdtree kd.backtrack" "threaded build" "threaded rt_intersect" "threaded threaded.single" \
            "threaded threaded.parallel"; do
    count $dir/whole $case
    whole=$n
    said=$(cat $dir/said)
    count $dir/${case%% *} $case
    test "$said" = "$(cat $dir/said)" || fail "$case: other hits"
    awk -v case="$case" -v a="$whole" -v b="$n" 'BEGIN { printf "  %-28s %11d %11d  %.4f\n", case, a, b, a / b; exit !(a <= 1.01 * b) }' || fail "$case: more than 1 %"
done

echo "2. what is beside the triangles, and met by no ray: instructions over those without it"
printf '  %-28s' ""
for thing in sphere instance motion plane stats; do printf '%10s' $thing; done
echo
for case in "bvh rt_intersect" "bvh bvh.stack" "bvh bvh.wide:16" "bvh bvh.simd" "bvh bvh.ranged" "kdtree kd.stack" "threaded threaded.single"; do
    count $dir/whole $case
    none=$n
    printf '  %-28s' "$case"
    for thing in sphere instance motion plane stats; do
        if test "$thing" = stats && test "${case#* }" = rt_intersect; then printf '%10s' -; continue; fi
        count $dir/whole $case $thing
        awk -v a="$n" -v b="$none" 'BEGIN { printf "%10.3f", a / b }'
    done
    echo
done

echo "3. a picture of 64 x 64 pixels and 4 samples: instructions a sample, random numbers, and rays to lights, mirrored, refracted"
for thing in none mirror glass checks bumps shutter motion lens lamp gloss filter; do
    count $dir/whole picture $thing
    instructions=$n
    count $dir/calls picture $thing
    drawn=$(calls rti_draw)
    awk -v thing=$thing -v n="$instructions" -v drawn="$drawn" '{ printf "  %-8s %8.0f %8.2f   %5.2f %5.2f %5.2f\n", thing, n / $1, drawn / $1, $2 / $1, $3 / $1, $4 / $1 }' $dir/said
    case $thing in
    none | mirror | glass | checks | bumps | shutter) test "$drawn" = 0 || fail "$thing: draws $drawn random numbers" ;;
    *) test "$drawn" -gt 0 || fail "$thing: draws no random number" ;;
    esac
    case $thing in
    glass) awk '{ exit !($4 > 0) }' $dir/said || fail "$thing: nothing is refracted" ;;
    *) awk '{ exit !($4 == 0) }' $dir/said || fail "$thing: refracted rays" ;;
    esac
done
exit $failed
