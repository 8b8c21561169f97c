#!/bin/sh
# check_layers.sh: the floors of sphpa.h. A section may use only sections that its Needs line names, and
# theirs. Contents, banners and bodies list the same sections in the same order; the closure block says
# what the Needs lines say; no body asks which other sections are compiled.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

awk -f tests/header.awk "$HEADER" > "$work/header" || failed "header.awk could not read $HEADER"
# records KIND: the second column of the records of that kind
records() { awk -v kind="$1" '$1 == kind { print $2 }' "$work/header"; }
# tell FILE: each of its lines is a failure
tell() { while IFS= read -r line; do failed "$line"; done < "$1"; }

# ---- the same sections, in the same order ----
for kind in contents public impl; do records $kind > "$work/$kind"; done
[ -s "$work/public" ] || failed "no banner (a comment that opens with /* ==== and >>NAME on its second line)"
for kind in contents impl; do
    name='table of contents'
    [ $kind = impl ] && name='banners of the implementations'
    if ! cmp -s "$work/public" "$work/$kind"; then
        failed "the $name and the banners of the declarations differ:"
        diff "$work/public" "$work/$kind" | sed -n 's/^</   only, or elsewhere, in the declarations: >>/p; s/^>/   only, or elsewhere, there: >>/p'
    fi
done
awk '$1 == "problem" { line = $2; sub(/^problem [0-9]+ /, ""); print "line " line ": " $0 }' "$work/header" > "$work/problems"
tell "$work/problems"

# ---- Needs lines against the closure block and the switches ----
awk -v outside="$outside" '
    $1 == "public" { order[++n] = $2; known[$2] = 1 }
    $1 == "needs" { said[$2] = 1; for (i = 3; i <= NF; i++) needs[$2, $i] = $i }
    $1 == "needs" { for (i = 3; i <= NF; i++) words[$2] = words[$2] " " $i }
    $1 == "implies" { implies[$2, $3] = 1; if ($3 != "base") direct[$2] = direct[$2] " " $3; else to_base[$2] = 1 }
    $1 == "asked" { asked[$2, $3] = 1 }
    $1 == "undef" { taken_back[$2] = 1 }
    $1 == "guard" { guarded[$2] = 1 }
    function reaches_base(name,    k, parts, m) {
        if (to_base[name]) return 1
        m = split(direct[name], parts, " ")
        for (k = 1; k <= m; k++) if (reaches_base(parts[k])) return 1
        return 0
    }
    END {
        for (i = 1; i <= n; i++) {
            name = order[i]
            rank[name] = i
            if (name == "base") continue
            if (!said[name]) print ">>" name " has no \"Needs:\" line"
            m = split(words[name], parts, " ")
            for (k = 1; k <= m; k++) {
                other = parts[k]
                if (other ~ /^(the|HDF5|library|and|none|nothing|-)$/) continue
                if (!(other in known)) print ">>" name " needs \"" other "\", which is no section"
                else if (!(other in rank)) print ">>" name " needs >>" other ", which stands below it"
                else if (other != "base" && !implies[name, other])
                    print ">>" name " needs >>" other " but SPHPA_WANT_" toupper(name) "_ does not ask for it in the closure block"
            }
            m = split(direct[name], parts, " ")
            for (k = 1; k <= m; k++)
                if (!((name, parts[k]) in needs))
                    print "the closure block lets >>" name " ask for >>" parts[k] ", which its Needs line does not name"
            if (!reaches_base(name)) print "asking for >>" name " does not bring >>base"
            if (!asked[name, "SPHPA_" toupper(name) "_IMPLEMENTATION"])
                print "nothing in the closure block reads SPHPA_" toupper(name) "_IMPLEMENTATION"
            if (index(" " outside " ", " " name " ")) {
                if (asked[name, "SPHPA_IMPLEMENTATION"]) print "SPHPA_IMPLEMENTATION implies >>" name ", which needs an outside library"
            } else if (!asked[name, "SPHPA_IMPLEMENTATION"]) print "SPHPA_IMPLEMENTATION does not imply >>" name
            if (!guarded[name]) print ">>" name ": no #if SPHPA_WANT_" toupper(name) "_ && !defined(SPHPA_" toupper(name) "_DONE_) before its bodies"
            if (!taken_back[name]) print "SPHPA_WANT_" toupper(name) "_ is not undefined at the end of the header"
        }
    }' "$work/header" > "$work/switches"
tell "$work/switches"

# ---- who declares what, as the compiler sees it ----
found=$(found_for "$CC")
with_hdf5=''
[ -n "$(value HDF5_FOUND "$found")" ] && with_hdf5='-DSPHPA_SNAPSHOT_IMPLEMENTATION'
[ -z "$with_hdf5" ] && skip "the private names of >>snapshot" "no HDF5"
printf '#include "sphpa.h"\n' > "$work/all.c"
# shellcheck disable=SC2086,SC2046
$CC -std=c11 -E -DSPHPA_IMPLEMENTATION $with_hdf5 $(value HDF5_FOUND_CFLAGS "$found") -I"$include" "$work/all.c" > "$work/all.i" ||
    failed "$CC -E does not read $HEADER"
awk -v file="$(basename "$HEADER")" -f tests/declared.awk "$work/all.i" > "$work/declared"

# ---- every use against them ----
awk -v blind="$([ -z "$with_hdf5" ] && echo $outside)" '
    FILENAME ~ /header$/ {
        if ($1 == "public") { order[++n] = $2; reach[$2, $2] = reach[$2, "base"] = 1 }
        if ($1 == "needs") for (i = 3; i <= NF; i++) words[$2] = words[$2] " " $i
        if ($1 == "span") { spans++; name_of[spans] = $2; from[spans] = $3; to[spans] = $4; half_of[spans] = $5 }
        if ($1 == "define") owner[$3] = owner[$3] " " $2
        if ($1 == "use") { uses++; use_in[uses] = $2; use_of[uses] = $3; use_at[uses] = $4; use_kind[uses] = $5 }
        next
    }
    function find(line,    s) { # the section and half that a line lies in; what precedes all is base
        for (s = 1; s <= spans; s++) if (line >= from[s] && line <= to[s]) { at_half = half_of[s]; return name_of[s] }
        at_half = line < first_over ? "public" : "none"
        return at_half == "public" ? "base" : ""
    }
    FNR == 1 { for (s = 1; s <= spans; s++) if (half_of[s] == "public" && to[s] > first_over) first_over = to[s] }
    {
        where = find($3)
        if (where == "") next
        if ($1 == "prototype" && at_half == "public") { public_in[$2] = where; public_at[$2] = $3 }
        else if ($1 == "prototype") { promised[$2] = promised[$2] " " where }
        else if ($1 == "body") { body_in[$2] = where; body_at[$2] = $3 }
        else owner[$2] = owner[$2] " " where
    }
    function allowed(section, name,    k, m, parts) {
        m = split(owner[name], parts, " ")
        for (k = 1; k <= m; k++) if (reach[section, parts[k]]) return 1
        return 0
    }
    END {
        # a function belongs to the section that declares it in public, a private one to that of its body
        for (f in promised) if (!(f in public_in) && !(f in body_in)) owner[f] = owner[f] promised[f]
        for (f in body_in) if (!(f in public_in)) owner[f] = owner[f] " " body_in[f]
        for (f in public_in) {
            owner[f] = public_in[f]
            if (!(f in body_in)) { if (public_in[f] != blind) print "line " public_at[f] ": " f " is declared and has no body" }
            else if (body_in[f] != public_in[f])
                print "line " body_at[f] ": " f " is declared in >>" public_in[f] ", its body stands in >>" body_in[f]
        }
        for (i = 1; i <= n; i++) { # sections stand in order, so what one needs is complete by then
            m = split(words[order[i]], parts, " ")
            for (k = 1; k <= m; k++)
                for (j = 1; j < i; j++) if (reach[parts[k], order[j]]) reach[order[i], order[j]] = 1
        }
        for (u = 1; u <= uses; u++) {
            name = use_of[u]
            if (name ~ /^SPHPA_(WANT_[A-Z0-9_]*_|[A-Z0-9_]*_DONE_|([A-Z0-9_]*_)?IMPLEMENTATION)$/) {
                # its own switch decides the linkage of what it declares
                if (name != "SPHPA_WANT_" toupper(use_in[u]) "_") print "line " use_at[u] ": >>" use_in[u] " asks what is compiled: " name
            } else if (name in owner) {
                if (!allowed(use_in[u], name)) {
                    split(owner[name], parts, " ")
                    print "line " use_at[u] ": >>" use_in[u] " uses " name " of >>" parts[1] ", which it does not need"
                }
            } else if (use_kind[u] != "switch" && use_in[u] != blind)
                print "line " use_at[u] ": >>" use_in[u] " uses " name ", which nothing declares"
        }
        print uses + 0 > "/dev/stderr"
    }' "$work/header" "$work/declared" 2> "$work/uses" | sort -t ' ' -k 2n > "$work/upward"
tell "$work/upward"
finish "$(wc -l < "$work/public" | tr -d ' ') sections in one order, $(cat "$work/uses") uses of their names, none upward"
