#!/bin/sh
# check_leave_out.sh: what a scene does not name is not in its program. The shock tube and the blast hold no
# symbol of solids, pores, yield, damage or Tillotson; the impact, which names them all, does. Prints the size of
# each scene's program, and how many such symbols it holds: the README's table.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

if ! have nm || ! have strip; then
    skip "what a program leaves out" "no nm or strip"
    finish "nothing to look with"
fi
if [ ! -f examples/sod.c ] || [ ! -f examples/pumice_impact.c ]; then
    skip "what a program leaves out" "examples/sod.c or examples/pumice_impact.c is missing"
    finish "nothing to look at"
fi
found=$(found_for "$CC")
[ -n "$(value GC_FLAGS "$found")" ] || { skip "what a program leaves out" "the linker has no --gc-sections"; finish "nothing left out"; }

scenes='sod sedov blast rotating_body porous_piston pumice_impact eos_only'
say "building $scenes"
(for scene in $scenes; do echo "$work/examples/$scene"; done) |
    xargs $MAKE --no-print-directory INNER=1 BUILD="$work" -j"$JOBS" > "$work/make.log" 2>&1 || {
    failed "they do not build:"
    tail -n 15 "$work/make.log"
    finish
}
unwanted='solid|pores|plastic|cracks|yield|damage|flaw|crush|palpha|tillotson'
of_scene() { nm "$work/examples/$1" | awk '{ print $NF }' | plain_symbols | grep -E "^sphpa_.*($unwanted)"; }

for scene in sod blast; do
    of_scene $scene > "$work/$scene.symbols"
    while IFS= read -r name; do failed "examples/$scene holds $name"; done < "$work/$scene.symbols"
done
# the same search must find them where they belong, or it proves nothing
for word in $(echo "$unwanted" | tr '|' ' '); do
    of_scene pumice_impact | grep -q "$word" || echo "$word"
done > "$work/unseen"
[ "$(of_scene pumice_impact | wc -l)" -gt 10 ] || failed "the search finds next to nothing in pumice_impact"
for scene in $scenes; do
    cp "$work/examples/$scene" "$work/$scene.stripped" && strip "$work/$scene.stripped"
    say "$scene: $(wc -c < "$work/$scene.stripped" | tr -d ' ') bytes stripped," \
        "$(of_scene "$scene" | grep -c solid) symbols of solids," \
        "$(of_scene "$scene" | grep -vc solid) of pores, yield, cracks or Tillotson"
done
[ "$(wc -c < "$work/sod.stripped")" -lt "$(wc -c < "$work/pumice_impact.stripped")" ] ||
    failed "the stripped sod is not smaller than pumice_impact"
[ -s "$work/unseen" ] && say "pumice_impact itself has no symbol with: $(tr '\n' ' ' < "$work/unseen")(inlined)"
finish "sod and blast hold none of $unwanted"
