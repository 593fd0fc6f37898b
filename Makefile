# rt.h: programs, tests and checks. `make help` lists the targets.

config ?= release
WARN    = -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Werror
LIBS    = -lm -lpthread -ldl

# config=NAME builds into build/NAME; release, the default, into build. -g1: lines and functions, which are all that reports tell; a
# compiler that tracks every variable too takes a third as long again
FLAGS_release  = -O2
FLAGS_scalar   = -O2 -DRT_NO_SIMD
FLAGS_asan     = -O1 -g1 -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
FLAGS_tsan     = -O1 -g1 -fsanitize=thread
B      := build$(if $(filter-out release,$(config)),/$(config))

# 1 where a program with Embree 3 links
EMBREE  = $(shell printf '\043include <embree3/rtcore.h>\nint main(void) { return !rtcNewDevice(0); }\n' | \
                  $(CC) -x c - -o /dev/null -lembree3 2>/dev/null && echo 1)
SUDO   := $(shell test "$$(id -u)" = 0 || command -v sudo)

# $(call get,TEST,NAME,PACKAGES): installs Debian's packages unless TEST holds, or says what to install
get = @$(1) >/dev/null 2>&1 || $(SUDO) apt-get install -y -q $(3) >/dev/null 2>&1 || \
       { $(SUDO) apt-get update -q >/dev/null 2>&1; $(SUDO) apt-get install -y -q $(3) >/dev/null 2>&1; } || \
       { echo "make: $(2) is missing and cannot be installed from here: install $(3)"; exit 1; }
need   = $(call get,command -v $(1),$(1),$(2))
# OpenCL: PoCL, which makes a device of any CPU, where there is no driver. What it compiles it keeps here.
opencl = $(call get,ls /etc/OpenCL/vendors/*.icd,OpenCL,pocl-opencl-icd ocl-icd-libopencl1)
export POCL_CACHE_DIR ?= $(CURDIR)/build/pocl

# the longest to compile first, so that no processor is idle at the end
all: $(B)/rt_test $(B)/accuracy $(B)/bench $(B)/animate $(B)/render $(B)/bake $(B)/lidar $(B)/recipes $(B)/hello $(B)/gpu_hello

COMPILE = $(CC) -std=c99 $(WARN) $(FLAGS_$(config)) $(CFLAGS) -I. -MMD -MP -MF $@.d -o $@ $<
$(B)/%: examples/%.c | $(B)
	$(COMPILE) $(LIBS)
$(B)/%: tests/%.c | $(B)
	$(COMPILE) $(LIBS)
# it runs for no time
$(B)/recipes: FLAGS_release = -O0
# built anew where Embree has come or gone since
$(B)/embree: FORCE | $(B)
	@echo "$(EMBREE)" | cmp -s - $@ || echo "$(EMBREE)" >$@
FORCE:
$(B)/bench $(B)/accuracy: $(B)/%: tests/%.c $(B)/embree | $(B)
	$(COMPILE) $(if $(EMBREE),-DRT_BENCH_EMBREE -lembree3) $(LIBS)
$(B) out:
	@mkdir -p $@
-include $(wildcard $(B)/*.d)

demo: $(B)/render $(B)/animate $(B)/bake $(B)/lidar $(B)/hello | out
	$(B)/hello
	$(B)/render cornell         -o out/cornell.ppm --size 720x720  --spp 16
	$(B)/render balls:5         -o out/balls.ppm   --size 960x720  --spp 9
	$(B)/render rings:3         -o out/rings.ppm   --size 720x720  --spp 9
	$(B)/render tetra:8         -o out/tetra.ppm   --size 720x720  --spp 9
	$(B)/render terrain:2000000 -o out/terrain.ppm --size 1200x675 --spp 9
	$(B)/render cloud:100000    -o out/cloud.ppm   --size 960x720  --spp 9
	$(B)/render sphere:20000    -o out/sphere.ppm  --size 720x720  --spp 9
	$(B)/render mirrors:4       -o out/mirrors.ppm --size 960x720  --spp 9 --depth 20
	$(B)/render glass:4         -o out/glass.ppm   --size 960x720  --spp 9 --depth 10
	$(B)/render textures        -o out/textures.ppm --size 960x640 --spp 9
	$(B)/render balls:4         -o out/lens.ppm    --size 960x720  --spp 64 --lens 0.06 --light-radius 0.6
	$(B)/animate -o out/animate --frames 6 --fps 6
	$(B)/bake examples/imp.obj -o out/imp.obj --two-sided
	$(B)/render out/imp.obj -o out/baked.ppm --size 720x720 --spp 16
	$(B)/lidar hall:20000 -o out/lidar.ply --from 0,1.8,-3 --to 0,1.8,-5 --channels 64

driver:
	$(opencl)
# two halves, side by side with -j2: the first, and the others
test: test-most test-dropin test-others
test-most: all driver
	@mkdir -p $(POCL_CACHE_DIR)
	$(B)/rt_test --without gpu.
test-dropin:
	CC="$(CC)" CXX="$(CXX)" sh tests/dropin.sh
test-others: all driver
	@mkdir -p $(POCL_CACHE_DIR)/others
	POCL_CACHE_DIR=$(POCL_CACHE_DIR)/others $(B)/rt_test gpu.
	$(B)/accuracy --quick

# error against run time: out/report.html, its plots, and all numbers as CSV
accuracy: $(B)/accuracy driver | out
	$(call need,gnuplot,gnuplot-nox)
	$(B)/accuracy --gpu --report out

# Embree comes in where it can be installed; bench says when it is not there
bench: | out
	-$(call get,test -n "$(EMBREE)",Embree,libembree-dev)
	$(MAKE) $(B)/bench
	$(B)/bench $(or $(BENCH),--paper all --svg out)

# Three parts, side by side with -j3: two long ones, and one that ends early and leaves the processors to them. Sanitizers see every test but those of OpenCL's drivers, which leak; of rt_gpu.h they see some; oclgrind, which does not know all of LLVM, sees every kernel, not optimised. Valgrind, 30 times slower, those that matter for memory; the thread sanitizer those with threads.
VALGRIND_TESTS = hits.mixed hits.spheres hits.short instances.deep instances.bad rays refit build.layouts build.quality kdtree.nested kdtree.options \
                 threaded.nested motion.bad ground.bad textures.check options stats shading raster.memory raster.errors raster.render loaders.obj.errors loaders.obj.numbers loaders.obj.textures loaders.nff
GPU_TESTS      = gpu.mistakes gpu.log gpu.memory gpu.async gpu.cycles gpu.small.pictures gpu.pictures.mistakes
OCLGRIND      ?= /usr/lib/oclgrind/liboclgrind-rt.so
THREAD_TESTS   = threads build.parallel shading.render raster.render
check: check-address check-others check-programs
check-address: all driver
	$(MAKE) config=asan build/asan/rt_test
	build/asan/rt_test --scale 8 --no-gpu
	ASAN_OPTIONS=detect_leaks=0 build/asan/rt_test --scale 8 $(GPU_TESTS)
check-programs:
	$(MAKE) config=asan build/asan/render build/asan/rt_fuzz
	build/asan/rt_fuzz 300
	build/asan/render rings:2 -o build/asan/rings.ppm --size 160x120
check-others: $(B)/rt_test $(B)/hello
	$(call need,valgrind,valgrind)
	$(call need,oclgrind,oclgrind)
	$(MAKE) config=tsan build/tsan/rt_test build/tsan/render
	build/tsan/rt_test --scale 2 --no-gpu $(THREAD_TESTS)
	build/tsan/render balls:2 -o build/tsan/balls.ppm --size 160x120 --threads 4
	valgrind -q --error-exitcode=1 --leak-check=full build/hello >/dev/null
	valgrind -q --error-exitcode=1 --leak-check=full build/rt_test --scale 8 --no-gpu $(VALGRIND_TESTS)
	RT_GPU_LIBRARY=$(OCLGRIND) oclgrind --build-options -disable-llvm-passes --data-races --check-api --max-errors 20 --log build/oclgrind.log build/rt_test --any-gpu gpu.small
	@test ! -s build/oclgrind.log || { cat build/oclgrind.log; exit 1; }

# libFuzzer where clang has it, FUZZ seconds (default 60); and random inputs with any compiler.
FUZZ ?= 60
fuzz: | build
	$(MAKE) config=asan build/asan/rt_fuzz
	build/asan/rt_fuzz 5000
	$(call need,clang,clang)
	clang -std=gnu99 -g -O1 -fsanitize=fuzzer,address,undefined -DRT_FUZZ_LIBFUZZER tests/rt_fuzz.c -o build/rt_fuzz_lib $(LIBS)
	@mkdir -p build/corpus
	build/rt_fuzz_lib -max_total_time=$(FUZZ) -max_len=4096 -artifact_prefix=build/ build/corpus

# every kernel on this machine's OpenCL device, in under 8 minutes; GPU: a scene and options of bench
gpu:
	sh tests/gpu.sh $(GPU)

# MATRIX: some of its parts, as "1 4". Longest first, and as many at once as there are processors; each in build/matrix/PART.log, and
# printed when it ends
MATRIX_PARTS = $(patsubst %,matrix-%,$(or $(MATRIX),3 4 2 1 5))
matrix: matrix-needs
	$(MAKE) -k -j$$(nproc) matrix-parts
matrix-parts: $(MATRIX_PARTS)
$(MATRIX_PARTS): matrix-%:
	@mkdir -p build/matrix
	@sh tests/matrix.sh $* >build/matrix/$*.log 2>&1; status=$$?; cat build/matrix/$*.log; exit $$status
matrix-needs:
	$(call need,g++,g++)
	$(call need,clang,clang)
	$(call need,i686-linux-gnu-gcc,gcc-i686-linux-gnu libc6-dev-i386-cross)
	$(call need,aarch64-linux-gnu-gcc,gcc-aarch64-linux-gnu libc6-dev-arm64-cross)
	$(call need,s390x-linux-gnu-gcc,gcc-s390x-linux-gnu libc6-dev-s390x-cross)
	$(call need,qemu-s390x,qemu-user)
	$(call need,x86_64-w64-mingw32-gcc-posix,gcc-mingw-w64-x86-64-posix)
	$(call need,wine,--no-install-recommends wine wine64)
	$(call need,emcc,--no-install-recommends emscripten)
	$(call need,valgrind,valgrind)

clean:
	rm -rf build out

help:
	@echo "make            build everything into build/"
	@echo "make demo       render the demo scenes to out/*.ppm"
	@echo "make test       all tests"
	@echo "make accuracy   error against run time: out/report.html, with CSV and plots"
	@echo "make bench      speed table, with Embree where libembree-dev is installed, and the papers' tables; BENCH='--help' tells the options"
	@echo "make gpu        every kernel of rt_gpu.h on this machine's OpenCL device: hits and speed; GPU='scene.obj --device NAME'"
	@echo "make check      tests under the address, undefined and thread sanitizers and valgrind"
	@echo "make matrix     compilers x standards x flags x opt-outs: warnings, sizes, equal hits, here and on other processors and systems"
	@echo "make fuzz       FUZZ=60 seconds of fuzzing the loaders, the builder and the traversals"
	@echo "make clean      remove build/ and out/"

.PHONY: FORCE all demo driver test test-most test-dropin test-others accuracy bench gpu check check-address check-others check-programs fuzz matrix matrix-needs matrix-parts $(MATRIX_PARTS) clean help
