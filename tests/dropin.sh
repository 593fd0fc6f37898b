#!/bin/sh
# rt.h dropped into programs of all kinds: what each of tests/dropin/*.c says on its first line, with $CC, $CXX, and clang where it is; and
# what an object with the code exports, calls and holds. Of what runs, most leave out what takes long to compile. Prints what fails.
cd "$(dirname "$0")/.." || exit 1
from=tests/dropin
dir=build/dropin
cc=${CC:-cc}
cxx=${CXX:-c++}
warn="-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Wundef -Werror -I."
few="-DRT_NO_PACKETS -DRT_NO_SHADING -DRT_NO_KDTREE -DRT_NO_THREADED"
none="$few -DRT_NO_SPHERES -DRT_NO_INSTANCES -DRT_NO_PLANES -DRT_NO_STATS -DRT_NO_SAMPLING -DRT_NO_SIMD"
cpp="-fno-exceptions -fno-rtti -x c++"
libs="-lm -ldl"
passed=0
failed=0
mkdir -p $dir/lib
cp rt.h $dir/lib/raytracer.h

# try NAME COMMAND...: the command must succeed
try()
{
    name=$1
    shift
    if "$@"; then passed=$((passed + 1)); else failed=$((failed + 1)); echo "FAIL dropin: $name: $*"; fi
}

# names NAME PATTERN NM-ARGUMENTS...: no symbol that nm lists is other than the pattern
names()
{
    name=$1 pattern=$2
    shift 2
    if ! nm -P "$@" >$dir/symbols; then
        failed=$((failed + 1))
        echo "FAIL dropin: $name: nm $*"
        return
    fi
    others=$(cut -d ' ' -f 1,2 $dir/symbols | grep -vxE "$pattern" | tr '\n' ';')
    try "$name" test -z "$others"
}

# everything, read by each compiler as each language, behind macros; static, without assertions; and with all left out that can be
for compiler in "$cc -std=c99" "clang -std=c99" "$cxx $cpp -std=c++11" "$cxx $cpp -std=c++20" "clang++ $cpp -std=c++11" "clang++ $cpp -std=c++20"; do
    command -v ${compiler%% *} >/dev/null || continue
    try "macros" $compiler $warn -fsyntax-only $from/macros.c
    try "static" $compiler $warn -fsyntax-only -DRT_STATIC -DNDEBUG $from/macros.c
    try "least" $compiler $warn -fsyntax-only $none $from/two_code.c
    try "least, rt_gpu.h" $compiler $warn -fsyntax-only $none $from/hooks_code.c
done

# two files that link, whatever language either is, and need no library of C++
for standard in "$cc -std=c99" "$cxx $cpp -std=c++11" "$cxx $cpp -std=c++20"; do
    command -v ${standard%% *} >/dev/null || { echo "dropin: not here: ${standard%% *}"; continue; }
    try "two_code, $standard" $standard $warn $few -O1 -c $from/two_code.c -o $dir/two_code.o
    for other in "$cc -std=c99" "$cxx $cpp -std=c++11"; do
        command -v ${other%% *} >/dev/null || continue
        try "two, $other" $other $warn $few -O0 -c $from/two.c -o $dir/two.o
        try "two, $standard and $other" $cc $dir/two.o $dir/two_code.o -o $dir/two $libs
        try "two, $standard and $other" $dir/two
    done
done
names "two_code exports" "(rt_[a-z0-9_]+ T)" -g --defined-only $dir/two_code.o

# two copies
try "static" $cc -std=c99 $warn $few -O1 -c $from/static.c -o $dir/static.o
try "static_other" $cc -std=c99 $warn $few -O1 -I$dir -c $from/static_other.c -o $dir/static_other.o
names "static exports" "main T" -g --defined-only $dir/static.o
names "static exports" "see_other T" -g --defined-only $dir/static_other.o
try "static" $cc $dir/static.o $dir/static_other.o -o $dir/static $libs
try "static" $dir/static

# each structure alone, single rays and packets, and all of them
for others in "" "-DRT_NO_KDTREE -DRT_NO_THREADED" "-DRT_NO_BVH -DRT_NO_THREADED" "-DRT_NO_BVH -DRT_NO_KDTREE" "-DRT_NO_BVH -DRT_NO_KDTREE -DRT_NO_PACKETS"; do
    try "structures" $cc -std=c99 $warn -O0 -DRT_NO_SHADING -DRT_NO_STATS $others $from/structures.c -o $dir/structures $libs
    try "structures $others" sh -c "$dir/structures >$dir/sum"
    test -n "$others" || cp $dir/sum $dir/sum_of_all
    try "structures $others: the same hits" cmp $dir/sum $dir/sum_of_all
done

# an allocator and assertions of one's own
try "hooks_code" $cc -std=c99 $warn -DRT_NO_PACKETS -O0 -c $from/hooks_code.c -o $dir/hooks_code.o
try "hooks" $cc -std=c99 $warn -O1 -c $from/hooks.c -o $dir/hooks.o
try "hooks" $cc $dir/hooks.o $dir/hooks_code.o -o $dir/hooks $libs
try "hooks" $dir/hooks

# a shared library
try "shared" $cc -std=c99 $warn $few -O1 -fPIC -shared -fvisibility=hidden $from/shared.c -o $dir/libshared.so $libs
names "shared exports" "(shared_sees T|_init T|_fini T|_edata D|_end B|__bss_start B)" -D -g --defined-only $dir/libshared.so
try "shared_user" $cc -std=c99 $warn $from/shared_user.c $dir/libshared.so -o $dir/shared_user
try "shared_user" env LD_LIBRARY_PATH=$dir $dir/shared_user

# all of it, for an address that is known: else tables of pointers are data until the program is loaded
try "whole" $cc -std=c99 $warn -O0 -fno-pie -c $from/macros.c -o $dir/whole.o
try "whole" $cc -no-pie $dir/whole.o -o $dir/whole $libs
try "whole" $dir/whole
names "exports" "(rt_[a-z0-9_]+|main) T" -g --defined-only $dir/whole.o
# constants and code; what main has of its own; nothing that can be written
names "holds" ".* [tTrR]|(main\.)?(balls|rays|hits|same|geometry|options)(\.[0-9]+)? b" --defined-only $dir/whole.o
# no printing, no files, no threads, no clock; opens OpenCL, as the environment tells, when asked to
names "calls" "(mem(cmp|cpy|move|set)|str(cmp|cspn|len|spn|str|toul)|(__isoc23_)?strtoul|v?snprintf|malloc|free|__assert_fail|dlopen|dlsym|getenv|_GLOBAL_OFFSET_TABLE_|__cpu_model|__stack_chk_fail|(ceil|copysign|cos|exp|exp2|fabs|floor|fma|fmax|fmin|frexp|ldexp|log|pow|sin|sqrt|tan)f?) U *" -u $dir/whole.o
try "hooks call neither malloc nor abort" sh -c "! nm -u $dir/hooks_code.o | grep -wE 'malloc|calloc|realloc|free|abort|__assert_fail'"

echo "$passed passed, $failed failed: dropin"
test $failed = 0
