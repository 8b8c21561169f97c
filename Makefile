# sphpa: every task. `make help` lists them. GNU make 3.81 or newer, Linux and macOS.
# Everything that is generated goes under build/.
#
# Two levels. The targets you name set up the machine (tests/deps.sh), then call make once more, with
# INNER=1, to build and run: only then is asked what compiler and libraries are there (tests/flags.sh).

BUILD ?= build
JOBS ?= $(shell getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)

# ---- what you may set: make CC=clang NATIVE=1 REAL=float test ----
CFLAGS ?= -O3
LDFLAGS ?=
EXTRA_CFLAGS ?=
NATIVE ?=
REAL ?= double
OPENMP ?=
HDF5 ?=
GSL ?=
NO_INSTALL ?=
ARGS ?=
export NO_INSTALL
# threads that wait give their core away: on a busy machine spinning ones cost many times the work
OMP_WAIT_POLICY ?= passive
export OMP_WAIT_POLICY
ifeq ($(origin CC),default)
CC := $(shell command -v cc >/dev/null 2>&1 && echo cc || { command -v gcc || command -v clang || echo cc; })
endif
# for the scripts too, as they were given
export CC NATIVE OPENMP HDF5 GSL HDF5_CFLAGS HDF5_LIBS

DEPS = sh tests/deps.sh
# jobs side by side, unless you gave -j yourself: then make's own count holds
SIDE_BY_SIDE = $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(JOBS))
# (its recipes begin with +: make sees $(MAKE) in a recipe, not behind a variable)
INNER_MAKE = $(MAKE) --no-print-directory INNER=1 $(SIDE_BY_SIDE)

# counted WHAT,FOLDER,NAMES: how many have passed, that is, have their FOLDER NAME.ok; fails unless all have
define counted
passed=0; bad=; for name in $(3); do \
    if [ -f $(2)$$name.ok ]; then passed=$$((passed + 1)); else bad="$$bad $$name"; fi; \
done; \
[ -z "$$bad" ] || echo "FAILED:$$bad"; \
set -- $$bad; echo "$(1): $$passed passed, $$# failed"; \
[ $$# -eq 0 ] && [ $$passed -gt 0 ]
endef

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
.PHONY: help deps deps-check check test impact impact-full sensitivity movie blast blast-paper examples \
        bench-eos stress-eos path-eos replay-eos tolerance-impact bench-riemann bench-sph bench-grid \
        leave-out stress-sph verify tutorials figures \
        book clean FORCE tests-run examples-build leave-out-run

help: ## list these targets (the default)
	@echo 'make TARGET [VARIABLE=value ..]'
	@echo
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' Makefile | awk -F '|' '{ printf "  %-16s %s\n", $$1, $$2 }'
	@echo
	@echo '  NATIVE=1      for this very processor      REAL=float   single precision state'
	@echo '  CC, CFLAGS    compiler and its flags       OPENMP=0, HDF5=0, GSL=0   leave it out'
	@echo '  ARGS="..."    handed to the program, as in make impact ARGS="--particles 10000"'
	@echo '  NO_INSTALL=1  never install anything       BUILD=dir    instead of build'

deps: ## install what impact and test need and this machine lacks
	@$(DEPS) impact
	@$(DEPS) test

deps-check: ## install everything that check uses
	@$(DEPS) check

# ---- the main job ----
IMPACT = $(BUILD)/examples/pumice_impact

impact: ## a nylon sphere breaks a pumice target: numbers, pictures in build/impact (a minute and a half)
	@$(DEPS) impact
	@+$(INNER_MAKE) $(IMPACT)
	@mkdir -p $(BUILD)/impact
	$(IMPACT) --out $(BUILD)/impact $(ARGS)

impact-full: ## the same with 300,000 particles; goes on where it was stopped
	@$(DEPS) impact
	@+$(INNER_MAKE) $(IMPACT)
	@mkdir -p $(BUILD)/impact-full
	$(IMPACT) --particles 300000 --out $(BUILD)/impact-full $(ARGS) --dry-run
	$(IMPACT) --particles 300000 --out $(BUILD)/impact-full --resume auto $(ARGS)

sensitivity: ## how the largest fragment depends on each assumption: build/sensitivity.csv; goes on
	@$(DEPS) impact
	@+$(INNER_MAKE) $(IMPACT)
	$(IMPACT) --sensitivity $(BUILD)/sensitivity.csv --out $(BUILD)/impact --resume auto $(ARGS)

movie: ## the impact as an animated GIF, correction and Balsara on beside off; goes on
	@$(DEPS) impact
	@+$(INNER_MAKE) $(IMPACT)
	$(IMPACT) --movie $(BUILD)/movie/impact.gif --out $(BUILD)/impact --resume auto $(ARGS)

# ---- blasts ----
BLAST = $(BUILD)/examples/blast
# seconds of wall clock for each method of each of the paper's runs
BLAST_SECONDS ?= 3600

blast: ## 1 kt by finite volumes, particles and their hybrid, against the 1-D solution: build/blast (some two minutes; ARGS="--dx 0.4": finer)
	@$(DEPS) impact
	@+$(INNER_MAKE) $(BLAST)
	$(BLAST) --dx 0.75 --convergence 1.5,1 --threads 0 --out $(BUILD)/blast $(ARGS)

# the domain that the paper's 10 kt would overrun is twice as wide here
blast-paper: ## the paper's 1 kt and 10 kt at 0.2, 0.1 and 0.05 m to 1 ms: build/blast-paper (hours; BLAST_SECONDS a method)
	@$(DEPS) impact
	@+$(INNER_MAKE) $(BLAST)
	@for dx in 0.2 0.1 0.05; do for case in '1 100' '10 200'; do \
	    set -- $$case; \
	    run="$(BLAST) --yield $$1 --size $$2 --dx $$dx --max-seconds $(BLAST_SECONDS) --out $(BUILD)/blast-paper/$$1kt_$$dx $(ARGS)"; \
	    echo "$$run"; $$run || exit $$?; \
	done; done
	$(BLAST) --kernels --max-seconds $(BLAST_SECONDS) --out $(BUILD)/blast-paper/kernels $(ARGS)

examples: ## build all examples into build/examples
	@$(DEPS) impact
	@+$(INNER_MAKE) examples-build

# ---- benchmarks ----
# what only tells something is asked of the first program alone
TELLS = $(filter --help -h --version --list,$(ARGS))
# the states of a small impact, kept: recorded again only where they are missing
STATES = $(BUILD)/bench/states.txt

bench-eos: ## P-alpha solvers side by side: time, evaluations, errors in build/bench/eos.csv
	@$(DEPS) bench
	@+$(INNER_MAKE) $(BUILD)/bench/bench_eos $(if $(TELLS),,$(STATES))
	$(BUILD)/bench/bench_eos --states $(STATES) --out $(BUILD)/bench $(ARGS)

stress-eos: ## the P-alpha solvers under stress, 1e7 states judged in long double (two minutes)
	@+$(INNER_MAKE) $(BUILD)/bench/stress_eos
	$(BUILD)/bench/stress_eos $(ARGS)

path-eos: ## a particle's path: implicit solves against the evolution form, error and time (half a minute)
	@+$(INNER_MAKE) $(BUILD)/bench/path_eos
	$(BUILD)/bench/path_eos --out $(BUILD)/bench $(ARGS)

replay-eos: ## one impact with each P-alpha solver: EOS and force ms a step, are the results equal? (a minute)
	@+$(INNER_MAKE) $(BUILD)/bench/replay_eos
	$(BUILD)/bench/replay_eos $(ARGS)

# double and float in one table: the first program leaves its answer for the second
TOLERANCE = $(BUILD)/bench/tolerance_impact
tolerance-impact: ## does a loose tolerance make damage ring? 1e-2 to 1e-14, double and float (five to ten minutes)
	@+$(INNER_MAKE) $(TOLERANCE)_double $(TOLERANCE)_float
	$(TOLERANCE)_double --out $(BUILD)/bench $(ARGS)
	$(TOLERANCE)_float --out $(BUILD)/bench $(ARGS)

bench-riemann: ## Riemann solvers on mixes of states, alone and in batches: time beside error (ten seconds)
	@+$(INNER_MAKE) $(BUILD)/bench/bench_riemann
	$(BUILD)/bench/bench_riemann --out $(BUILD)/bench $(ARGS)

# both precisions, one after the other; the second shows both
bench-sph: ## particles a second and core, gas to porous solid: build/bench/sph.csv (half an hour; ARGS=--quick: 3 minutes)
	@+$(INNER_MAKE) $(BUILD)/bench/bench_sph_double $(BUILD)/bench/bench_sph_float
	$(BUILD)/bench/bench_sph_double --out $(BUILD)/bench $(ARGS)
	$(if $(TELLS),,$(BUILD)/bench/bench_sph_float --out $(BUILD)/bench --append $(ARGS))

bench-grid: ## finite volumes: cell-steps a second and core, errors beside them: build/bench/grid.csv (four minutes; ARGS=--quick: 10 s)
	@+$(INNER_MAKE) $(BUILD)/bench/bench_grid
	$(BUILD)/bench/bench_grid --out $(BUILD)/bench $(ARGS)

leave-out: ## what each kind of scene pays for: bytes, time, program, compile time (four minutes)
	@+$(INNER_MAKE) leave-out-run

# likewise: the first leaves its rows, the second prints one table and has the last word
STRESS = $(BUILD)/bench/stress_sph
stress-sph: ## what happens at the edge: extreme scenes, double and float: build/stress (six minutes)
	@+$(INNER_MAKE) $(STRESS)_double $(STRESS)_float
	$(STRESS)_double --out $(BUILD)/stress --leave rows $(ARGS)
	$(if $(TELLS),,$(STRESS)_float --out $(BUILD)/stress --join rows $(ARGS))

# double and float in one table: the double program leaves its rows for the float one, which counts all
VERIFY = $(BUILD)/bench/verify
verify: ## standard problems: how wrong, how long, what is conserved, in build/verify (half an hour; ARGS=--quick: 4 minutes)
	@+$(INNER_MAKE) $(VERIFY)_double $(VERIFY)_float
	$(VERIFY)_double --out $(BUILD)/verify --join $(ARGS)
	$(if $(TELLS),,$(VERIFY)_float --out $(BUILD)/verify --join $(ARGS))

# ---- the book ----
CHAPTERS := $(patsubst tutorials/%.md,%,$(sort $(wildcard tutorials/[0-9][0-9]_*.md)))
# the later ones run longer: with those first, two cores are done soonest
LAST_FIRST := $(shell printf '%s\n' $(CHAPTERS) | sort -r)
# tutorial-08: the chapter whose name begins so
TUTORIALS := $(foreach name,$(CHAPTERS),tutorial-$(firstword $(subst _, ,$(name))))
.PHONY: $(TUTORIALS)

tutorials: ## the book's chapters: tangled, built, run, compared with their text (five minutes); tutorial-08: one
	@$(DEPS) tutorials
	@rm -f $(CHAPTERS:%=$(BUILD)/tutorials/%.ok)
	@+$(INNER_MAKE) -k $(LAST_FIRST:%=$(BUILD)/tutorials/%.ok) || true
	@$(call counted,chapters,$(BUILD)/tutorials/,$(CHAPTERS))

$(TUTORIALS):
	@$(DEPS) tutorials
	@+$(INNER_MAKE) -B $(BUILD)/tutorials/$(filter $(@:tutorial-%=%)_%,$(CHAPTERS)).ok

tutorial-%:
	@echo 'there is no chapter $*; there are: $(TUTORIALS)' >&2; exit 2

figures: ## run the chapters and put their pictures into tutorials/img
	@$(DEPS) tutorials
	@+FIGURES=1 $(INNER_MAKE) -B $(CHAPTERS:%=$(BUILD)/tutorials/%.ok)

book: ## the book as a site to read in a browser, without a network: build/book/index.html
	@$(DEPS) book
	BUILD=$(BUILD) sh tutorials/book.sh

# ---- tests and checks ----
test: ## build and run the tests, one program a section, side by side
	@$(DEPS) test
	@+$(INNER_MAKE) tests-run

# Side by side; what one says is shown in one piece. Each says what it skipped; CHECK_STRICT=1 (or CI) makes
# a skip a failure. A check is any tests/check_*.sh: tests/lib.sh says what is asked of one.
CHECKS := $(sort $(wildcard tests/check_*.sh))

check: ## compile matrix, names, layers, what is left out, sanitizers, float, readers of the snapshots, command lines
	@mkdir -p $(BUILD)/check && : > $(BUILD)/check/skipped && rm -f $(CHECKS:tests/%=$(BUILD)/check/%.*)
	@+$(INNER_MAKE) -k $(CHECKS:tests/%=$(BUILD)/check/%.ok) || true
	@if [ -s $(BUILD)/check/skipped ]; then echo "skipped:"; sort -u $(BUILD)/check/skipped | sed 's/^/  /'; \
	    echo "  (make deps-check installs what is missing)"; fi
	@$(call counted,checks,$(BUILD)/check/,$(CHECKS:tests/%=%))

clean: ## remove build/
	rm -rf $(BUILD)

# ======== the inner level: what is built, and how ========
ifneq ($(INNER)$(filter $(BUILD)/%,$(MAKECMDGOALS)),)

# What was found here, and the flags given. Asked each time (a third of a second), written only when
# something changed: then everything is compiled anew.
-include $(BUILD)/flags.mk
STAMP = $(CC) | $(CFLAGS) | $(LDFLAGS) | $(EXTRA_CFLAGS) | $(NATIVE) | $(REAL)
$(BUILD)/flags.mk: FORCE
	@mkdir -p $(BUILD)/examples $(BUILD)/tests
	@STAMP='$(STAMP)' sh tests/flags.sh > $@.new
	@if cmp -s $@.new $@; then rm $@.new; else mv $@.new $@; fi
FORCE:

# No -ffast-math: NaN must stay visible. These flags cost no such thing: loops vectorise, and where the
# processor has fused multiply-adds (NATIVE=1) -std=c11 does not forbid them.
MATH_FLAGS = -fno-math-errno -fno-trapping-math -ffp-contract=fast
WARNINGS = -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wundef -Wdouble-promotion \
           -Wcast-qual -Wstrict-prototypes
# cmocka's macros convert as they like, and do not tell the compiler that a failure does not return
TEST_WARNINGS = -Wall -Wextra -Wno-maybe-uninitialized
# each function in a section of its own, so that the linker drops those that nothing calls
SECTIONS = -ffunction-sections -fdata-sections
REAL_FLAGS_float = -DSPHPA_FLOAT
ifeq ($(filter $(REAL),float double),)
$(error REAL=$(REAL): give REAL=float or REAL=double)
endif

COMPILE = $(CC) -std=c11 $(CFLAGS) $(MATH_FLAGS) $(SECTIONS) $(NATIVE_FLAGS) $(OPENMP_CFLAGS) \
          $(REAL_FLAGS_$(REAL)) -I. $(EXTRA_CFLAGS)
LINK_FLAGS = $(LDFLAGS) $(GC_FLAGS)
LIBS = $(OPENMP_LIBS) -lm

# HDF5 goes to the programs that name it: SPHPA_WITH_HDF5 (can do without), or the section itself (cannot)
MAY_USE_HDF5 := $(shell grep -l 'SPHPA_WITH_HDF5' examples/*.c tests/test_*.c 2>/dev/null)
MUST_USE_HDF5 := $(filter-out $(MAY_USE_HDF5), \
    $(shell grep -l 'SPHPA_SNAPSHOT_IMPLEMENTATION' examples/*.c tests/test_*.c 2>/dev/null))
HDF5_USERS := $(if $(HDF5_FOUND),$(MAY_USE_HDF5) $(MUST_USE_HDF5))
hdf5_cflags = $(if $(filter $<,$(HDF5_USERS)),-DSPHPA_WITH_HDF5 $(HDF5_FOUND_CFLAGS))
hdf5_libs = $(if $(filter $<,$(HDF5_USERS)),$(HDF5_FOUND_LIBS))
SKIPPED := $(if $(HDF5_FOUND),,$(MUST_USE_HDF5))

EXAMPLES := $(patsubst examples/%.c,$(BUILD)/examples/%,$(filter-out $(SKIPPED),$(wildcard examples/*.c)))
# ONLY=tests/test_gas.c: no others
ONLY ?= $(wildcard tests/test_*.c)
TESTS := $(patsubst tests/%.c,$(BUILD)/tests/%,$(filter-out $(SKIPPED),$(ONLY)))

# what runs for minutes gets the vectors of today's machines, where this one has them
VECTORS = $(if $(NATIVE_FLAGS),,$(BENCH_FLAGS))
$(IMPACT) $(BLAST): EXAMPLE_FLAGS = $(VECTORS)
$(BUILD)/examples/%: examples/%.c sphpa.h $(BUILD)/flags.mk $(wildcard examples/*.h)
	$(COMPILE) $(EXAMPLE_FLAGS) $(WARNINGS) $(hdf5_cflags) $< -o $@ $(LINK_FLAGS) $(hdf5_libs) $(LIBS)

# what times things gets them too, and the libraries whose solvers are timed beside ours
BENCH_COMPILE = $(COMPILE) $(VECTORS)
BENCH_ABOUT = -DBENCH_COMPILER='"$(COMPILER_NAME)"' \
              -DBENCH_FLAGS='"$(subst ",,$(subst ',,$(filter-out $(CC),$(BENCH_COMPILE))))"'
$(BUILD)/bench/bench_%: bench/bench_%.c sphpa.h $(BUILD)/flags.mk $(wildcard bench/*.h) examples/example.h
	@mkdir -p $(@D)
	$(BENCH_COMPILE) $(WARNINGS) $(BENCH_ABOUT) $(if $(GSL_FOUND),-DBENCH_WITH_GSL $(GSL_CFLAGS)) $< -o $@ \
	    $(LINK_FLAGS) $(GSL_LIBS) $(LIBS)

# these too, without the libraries
TIMED = $(addprefix $(BUILD)/bench/,path_eos replay_eos)
$(TIMED): $(BUILD)/bench/%: bench/%.c sphpa.h $(BUILD)/flags.mk $(wildcard bench/*.h examples/*.h) \
    examples/pumice_impact.c
	@mkdir -p $(@D)
	$(BENCH_COMPILE) $(WARNINGS) $(BENCH_ABOUT) $< -o $@ $(LINK_FLAGS) $(LIBS)

# one source, both precisions, whatever REAL is
both = $(addprefix $(BUILD)/bench/$(1)_,double float)
BOTH_NEED = sphpa.h $(BUILD)/flags.mk $(wildcard bench/*.h examples/*.h)
BOTH_REAL = $(if $(findstring _float,$@),-DSPHPA_FLOAT)
BOTH_END = $(BOTH_REAL) $(WARNINGS) $(BENCH_ABOUT) $< -o $@ $(LINK_FLAGS) $(LIBS)
$(call both,tolerance_impact): bench/tolerance_impact.c $(BOTH_NEED) examples/pumice_impact.c
	@mkdir -p $(@D)
	$(filter-out -DSPHPA_FLOAT,$(COMPILE)) $(BOTH_END)
# the engine's share one object of the header for each precision
ENGINE = bench_sph stress_sph verify
define engine
@mkdir -p $(@D)
$(filter-out -DSPHPA_FLOAT,$(BENCH_COMPILE)) $(filter %.o,$^) $(BOTH_END)
endef
$(BUILD)/bench/sphpa_double.o $(BUILD)/bench/sphpa_float.o: sphpa.h $(BUILD)/flags.mk
	@mkdir -p $(@D)
	$(filter-out -DSPHPA_FLOAT,$(BENCH_COMPILE)) $(BOTH_REAL) $(WARNINGS) -DSPHPA_IMPLEMENTATION -x c -c $< -o $@
$(ENGINE:%=$(BUILD)/bench/%_double): $(BUILD)/bench/%_double: bench/%.c $(BOTH_NEED) $(BUILD)/bench/sphpa_double.o
	$(engine)
$(ENGINE:%=$(BUILD)/bench/%_float): $(BUILD)/bench/%_float: bench/%.c $(BOTH_NEED) $(BUILD)/bench/sphpa_float.o
	$(engine)

$(BUILD)/bench/%: bench/%.c sphpa.h $(BUILD)/flags.mk $(wildcard bench/*.h) examples/example.h
	@mkdir -p $(BUILD)/bench
	$(COMPILE) $(WARNINGS) $< -o $@ $(LINK_FLAGS) $(LIBS)

# Tests that look at nothing private name no implementation: it is compiled once for all of them.
SHARE_LIBRARY := $(patsubst tests/%.c,$(BUILD)/tests/%,$(shell grep -L '^#define SPHPA_.*IMPLEMENTATION' tests/test_*.c))
$(SHARE_LIBRARY): $(BUILD)/tests/sphpa.o
$(BUILD)/tests/sphpa.o: sphpa.h $(BUILD)/flags.mk
	$(COMPILE) $(TEST_WARNINGS) -DSPHPA_IMPLEMENTATION -x c -c $< -o $@
$(BUILD)/tests/test_%: tests/test_%.c sphpa.h $(BUILD)/flags.mk $(wildcard tests/*.h)
	$(COMPILE) $(TEST_WARNINGS) -Itests $(hdf5_cflags) $(CMOCKA_CFLAGS) $< $(filter %.o,$^) -o $@ \
	    $(LINK_FLAGS) $(hdf5_libs) $(CMOCKA_LIBS) $(LIBS)

# A chapter is done when its .ok is there: the line that its check said. Output is shown in one piece.
CHAPTER_TOOLS := $(wildcard tutorials/*.awk) tutorials/check.sh
$(BUILD)/tutorials/%.ok: tutorials/%.md tutorials/answers/%.md sphpa.h $(CHAPTER_TOOLS)
	@mkdir -p $(@D)
	@BUILD=$(BUILD) sh tutorials/check.sh $* > $@.new && mv $@.new $@ && cat $@

$(BUILD)/check/%.ok: tests/% FORCE
	@rm -f $@; PYTHON=$$(sh tests/python.sh); \
	BUILD=$(BUILD) JOBS=$(JOBS) MAKE='$(MAKE)' CHECK_SKIPS=$(BUILD)/check/skipped; \
	if [ -n "$$CI" ] && [ "$$CI" != false ]; then CHECK_STRICT=1; fi; \
	export PYTHON BUILD JOBS MAKE CHECK_SKIPS CHECK_STRICT; \
	start=$$(date +%s); sh $< > $(BUILD)/check/$*.log 2>&1; status=$$?; \
	if [ $$status = 77 ]; then echo $< >> $$CHECK_SKIPS; [ "$$CHECK_STRICT" = 1 ] || status=0; fi; \
	cat $(BUILD)/check/$*.log; echo "-- $<: $$(($$(date +%s) - start)) s"; \
	[ $$status = 0 ] && touch $@

leave-out-run:
	OUT=$(BUILD)/bench COMPILE='$(BENCH_COMPILE) $(WARNINGS)' LINK='$(LINK_FLAGS) $(LIBS)' sh bench/leave_out.sh $(ARGS)

$(STATES): | $(IMPACT)
	@echo 'an impact, for the states that its particles go through'
	$(IMPACT) --particles 2000 --projectile-particles 200 --t-end 4e-5 --compare off --snapshots off \
	    --quiet --out $(BUILD)/bench/impact --record-states $@ > /dev/null

examples-build: $(EXAMPLES)
	@for name in $(SKIPPED); do echo "skipped: $$name (no HDF5)"; done

# Programs run side by side, on two threads each (many of the long tests have use for one alone); what one
# says is shown in one piece. A program has passed when its .ok is there.
$(BUILD)/tests/%.ok: $(BUILD)/tests/% FORCE
	@rm -f $@; OMP_NUM_THREADS=$${OMP_NUM_THREADS:-2} $< > $<.log 2>&1 && touch $@; cat $<.log; [ -f $@ ]

tests-run: $(TESTS)
	@rm -f $(TESTS:=.ok)
	@+$(INNER_MAKE) -k $(TESTS:=.ok) || true
	@for name in $(filter tests/%,$(SKIPPED)); do echo "skipped: $$name (no HDF5)"; done
	@$(call counted,programs,,$(TESTS))
else
# the outer level's targets one after the other: two of them may want to install something
.NOTPARALLEL:
endif
