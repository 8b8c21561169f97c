#!/bin/sh
# check_names.sh: nothing leaves sphpa.h without its prefix: no symbol, no macro, no type, no constant.
# No writable data either (hidden state), nothing global under SPHPA_STATIC, and the functions that touch
# state are renamed in the float build.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

found=$(found_for "$CC")
hdf5_cflags=$(value HDF5_FOUND_CFLAGS "$found")
everything=-DSPHPA_IMPLEMENTATION
if [ -n "$(value HDF5_FOUND "$found")" ]; then
    everything="$everything -DSPHPA_SNAPSHOT_IMPLEMENTATION"
else
    skip "the names of >>snapshot" "no HDF5"
fi
openmp=$(value OPENMP_CFLAGS "$found")
printf '#include "sphpa.h"\n' > "$work/all.c"
# compile OBJECT FLAGS..: position-dependent, so that tables of constants stay among the constants
compile() {
    object=$1
    shift
    # shellcheck disable=SC2086
    $CC -std=c11 -O0 -fno-pic $everything $hdf5_cflags -I"$include" "$@" -c "$work/all.c" -o "$object" ||
        failed "does not compile: $*"
}
# tell WHAT: each word on stdin is a failure
tell() { while IFS= read -r name; do failed "$1: $name"; done; }

have nm || { skip "symbols" "no nm"; finish "nothing to look with"; }

# ---- symbols ----
compile "$work/double.o"
compile "$work/float.o" -DSPHPA_FLOAT
compile "$work/static.o" -DSPHPA_STATIC
objects="$work/double.o $work/float.o"
if [ -n "$openmp" ]; then
    # shellcheck disable=SC2086
    compile "$work/openmp.o" $openmp
    objects="$objects $work/openmp.o"
fi
for object in $objects; do
    # a named critical section makes a symbol of its name
    symbols "$object" | sed 's/^\.gomp_critical_user_//' | grep -v '^sphpa_' > "$work/bad"
    tell "global symbol without sphpa_ in $(basename "$object")" < "$work/bad"
    nm "$object" | awk 'NF >= 2 && $(NF - 1) ~ /^[BbCcDdSs]$/ { print $NF }' | grep -v '^\.gomp_critical_user_\|^ltmp\|^l_' > "$work/bad"
    tell "writable data in $(basename "$object")" < "$work/bad"
done
symbols "$work/static.o" > "$work/bad"
tell "global under SPHPA_STATIC" < "$work/bad"
count=$(symbols "$work/double.o" | wc -l | tr -d ' ')
[ "$count" -gt 0 ] || failed "nm shows no global symbol in an object with everything: this check sees nothing"

# ---- macros that the header itself leaves behind ----
# -dD keeps the #define and #undef lines and the file they come from
macros() { # macros FLAGS..
    # shellcheck disable=SC2086
    $CC -std=c11 -E -dD $hdf5_cflags -I"$include" "$@" "$work/all.c" | awk -v file="$(basename "$HEADER")" '
        /^# *[0-9]+ *"/ {
            name = $0
            sub(/^[^"]*"/, "", name); sub(/".*$/, "", name); sub(/^.*\//, "", name)
            inside = name == file
            next
        }
        inside && /^ *# *define / { sub(/^ *# *define +/, ""); text = $0; sub(/[^A-Za-z0-9_].*$/, ""); value = text; sub(/^[^ ]* */, "", value); left[$0] = value; next }
        /^ *# *undef / { name = $2; sub(/[^A-Za-z0-9_].*$/, "", name); if (inside && name !~ /^SPHPA_/) print "#undef " name; delete left[name] }
        END { for (name in left) print name, left[name] }'
}
for build in "-DSPHPA_PLAIN_BUILD" "$everything" "$everything -DSPHPA_FLOAT" "$everything -DSPHPA_STATIC" "$everything $openmp"; do
    # shellcheck disable=SC2086
    macros $build > "$work/macros"
    # the float build renames: sphpa_x is sphpa_x_f32, and nothing else
    awk '$1 == "#undef" { print; next }
         $1 ~ /^SPHPA_/ && $1 !~ /^SPHPA_WANT_/ { next }
         $1 ~ /^sphpa_/ && $2 == $1 "_f32" { next }
         { print $1 }' "$work/macros" > "$work/bad"
    tell "macro left behind, or taken away, with ${build#-DSPHPA_PLAIN_BUILD}" < "$work/bad"
done
[ -s "$work/macros" ] || failed "no macro was seen: this check sees nothing"

# ---- types, constants, private functions ----
# shellcheck disable=SC2086
$CC -std=c11 -E $everything $hdf5_cflags -I"$include" "$work/all.c" |
    awk -v file="$(basename "$HEADER")" -f tests/declared.awk > "$work/declared"
awk '$2 !~ /^(sphpa|SPHPA)_/ || ($1 == "constant") != ($2 ~ /^SPHPA_/) { print "line " $3 ": " $1 " " $2 }' \
    "$work/declared" | sort -u > "$work/bad"
tell "wrong prefix (sphpa_ for functions and types, SPHPA_ for constants)" < "$work/bad"

# ---- the float build: what stands on particles is renamed, the material line and the tree are not ----
awk -f tests/header.awk "$HEADER" > "$work/header"
for build in double float; do symbols "$work/$build.o" | sort -u > "$work/$build.symbols"; done
awk '
    FILENAME ~ /header$/ {
        if ($1 == "public") order[++n] = $2
        if ($1 == "needs") for (i = 3; i <= NF; i++) words[$2] = words[$2] " " $i
        if ($1 == "span" && $5 == "public") { spans++; name_of[spans] = $2; from[spans] = $3; to[spans] = $4 }
        next
    }
    FILENAME ~ /declared$/ {
        if ($1 == "prototype") for (s = 1; s <= spans; s++) if ($3 >= from[s] && $3 <= to[s]) section[$2] = name_of[s]
        next
    }
    FNR == 1 { # state: particles, and every section that needs it
        state["particles"] = 1
        for (i = 1; i <= n; i++) {
            m = split(words[order[i]], parts, " ")
            for (k = 1; k <= m; k++) if (state[parts[k]]) state[order[i]] = 1
        }
    }
    {
        plain = $1
        renamed = sub(/_f32$/, "", plain)
        if (!(plain in section)) next
        if (state[section[plain]] && !renamed) print plain " of >>" section[plain] " touches state: it must be " plain "_f32"
        if (!state[section[plain]] && renamed) print $1 " of >>" section[plain] ": must have the same name in both builds"
    }' "$work/header" "$work/declared" "$work/float.symbols" > "$work/bad"
tell "float build" < "$work/bad"
finish "$count global symbols, $(wc -l < "$work/macros" | tr -d ' ') macros, $(awk '{ print $2 }' "$work/declared" | sort -u | wc -l | tr -d ' ') declared names: all with the prefix"
