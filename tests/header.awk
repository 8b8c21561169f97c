# header.awk: reads sphpa.h and prints what the checks want to know of it, one record a line.
#
#   contents NAME LINE        a row of the table of contents (the first comment of the file)
#   public NAME LINE          the banner of a section's declarations
#   impl NAME LINE            the banner of its bodies
#   needs NAME A B ..         its "Needs:" line
#   guard NAME LINE           the #if around its bodies, where it has the right form
#   span NAME FIRST LAST HALF the lines of a section, HALF is public or impl
#   implies A NAME            the closure block: who wants A gets NAME
#   asked NAME MACRO          the closure block: MACRO asks for NAME
#   undef NAME LINE           its switch is taken back at the end
#   define NAME IDENT LINE    a macro, and the section it belongs to (base: also what precedes base)
#   use NAME IDENT LINE KIND  an identifier in a section; KIND: code, or switch (in an #if)
#   problem LINE TEXT         something that is wrong in itself
#
# Comments, strings and character constants are taken out before identifiers are read.

function close_span(last) {
    if (section != "") print "span", section, first, last, half
    section = ""
}

# a banner is a comment line with a tag, directly under the line that opens the comment
function banner(line,    name, rest) {
    name = line
    sub(/^ *>>/, "", name)
    rest = name
    sub(/[^a-z0-9_].*$/, "", name)
    sub(/^[a-z0-9_]+ */, "", rest)
    close_span(NR - 2)
    section = name
    first = NR - 1
    half = rest ~ /^implementation/ ? "impl" : "public"
    if (half == "impl" && !over) print "problem", NR, ">>" name ": bodies before #endif /* SPHPA_H */"
    if (half == "public" && over) print "problem", NR, ">>" name ": declarations after #endif /* SPHPA_H */"
    print half, name, NR
    wanted = ""
    in_needs = 0
}

# "Needs: a, b (why), c. Read next: .." may go on over lines; it ends at a full stop
function needs(line,    text) {
    if (line ~ /Needs:/) {
        in_needs = 1
        wanted = ""
        sub(/^.*Needs:/, "", line)
    }
    if (!in_needs) return
    text = line
    if (text ~ /\.|Read next|====|\*\//) {
        sub(/(\.|Read next|====|\*\/).*$/, "", text)
        in_needs = 0
    }
    wanted = wanted " " text
    if (in_needs) return
    gsub(/\([^)]*\)/, " ", wanted)
    gsub(/,|;|>>/, " ", wanted)
    gsub(/ +/, " ", wanted)
    sub(/ $/, "", wanted)
    print "needs", section wanted
}

# takes out comments (also those that go on over lines), strings and character constants
function strip(line,    out, quote) {
    out = ""
    while (line != "") {
        if (in_comment) {
            if (!match(line, /\*\//)) return out
            line = substr(line, RSTART + 2)
            in_comment = 0
            continue
        }
        if (!match(line, /\/\*|\/\/|"|'/)) return out line
        out = out substr(line, 1, RSTART - 1) " "
        quote = substr(line, RSTART, 1)
        if (substr(line, RSTART, 2) == "/*") {
            in_comment = 1
            line = substr(line, RSTART + 2)
        } else if (quote == "/") {
            return out
        } else {
            line = substr(line, RSTART + 1)
            while (line != "" && substr(line, 1, 1) != quote)
                line = substr(line, substr(line, 1, 1) == "\\" ? 3 : 2)
            line = substr(line, 2)
        }
    }
    return out
}

function lower_section(macro,    name) { # SPHPA_WANT_TREE_ -> tree
    name = macro
    sub(/^SPHPA_(WANT_)?/, "", name)
    sub(/_(IMPLEMENTATION|DONE_)?$/, "", name)
    return tolower(name)
}

# outside of the sections: the closure block (#if with its lines joined, then #define .. 1), the guards
# around the bodies, and what is taken back at the end
function switches(code,    name, word) {
    if (code ~ /^ *# *if/) condition = ""
    if (code ~ /^ *# *if/ || continued) condition = condition " " code
    if (code ~ /^ *# *(define|undef) +SPHPA_WANT_/) {
        match(code, /SPHPA_[A-Z0-9_]+/)
        name = lower_section(substr(code, RSTART, RLENGTH))
        if (code ~ /undef/) print "undef", name, NR
        if (code !~ /define.* 1 *$/) return
        while (match(condition, /SPHPA_[A-Z0-9_]+/)) {
            word = substr(condition, RSTART, RLENGTH)
            condition = substr(condition, RSTART + RLENGTH)
            if (word ~ /^SPHPA_WANT_/) print "implies", lower_section(word), name
            else if (word ~ /IMPLEMENTATION$/) print "asked", name, word
        }
    }
    if (match(code, /^ *# *if +SPHPA_WANT_[A-Z0-9]+_ *&& *!defined\(SPHPA_[A-Z0-9]+_DONE_\) *$/)) {
        match(code, /SPHPA_WANT_[A-Z0-9]+_/)
        name = lower_section(substr(code, RSTART, RLENGTH))
        if (index(code, "(SPHPA_" toupper(name) "_DONE_)")) print "guard", name, NR
    }
}

function identifiers(code,    kind, start, word, before, after, owner) {
    kind = (code ~ /^ *# *(if|elif|undef)/ || continued && in_if) ? "switch" : "code"
    in_if = kind == "switch"
    owner = section
    if (owner == "" && !over) owner = "base"
    if (owner == "") return
    if (match(code, /^ *# *define +/)) {
        start = substr(code, RLENGTH + 1)
        match(start, /^[A-Za-z0-9_]+/)
        word = substr(start, 1, RLENGTH)
        # the renaming of the float build is written before the first section
        if (section != "" || word !~ /^sphpa_/) print "define", owner, word, NR
    }
    if (section == "") return
    before = ""
    while (match(code, /[A-Za-z_][A-Za-z0-9_]*/)) {
        word = substr(code, RSTART, RLENGTH)
        before = before substr(code, 1, RSTART - 1)
        after = substr(code, RSTART + RLENGTH)
        # half of a name that ## makes is no name
        if (word ~ /^(sphpa|SPHPA)_/ && before !~ /## *$/ && after !~ /^ *##/)
            print "use", section, word, NR, kind
        before = before word
        code = after
    }
}

BEGIN { heading = 1 }
{
    sub(/\r$/, "")
    if (heading) { # the first comment of the file
        if ($0 ~ /^ *(\*|\/\/)? *>>[a-z0-9_]+( |$)/) {
            row = $0
            sub(/^.*>>/, "", row)
            sub(/[^a-z0-9_].*$/, "", row)
            print "contents", row, NR
        }
        if ($0 ~ /\*\// || ($0 !~ /^ *\/\*/ && NR == 1)) heading = 0
    } else if (in_comment && previous ~ /^\/\* ====/ && $0 ~ /^ *>>[a-z0-9_]+( |$)/) {
        banner($0)
    }
    if (section != "" && in_comment) needs($0)
    if ($0 ~ /^#endif.*\/\* *SPHPA_H *\*\//) {
        close_span(NR - 1)
        over = 1
    } else if (match($0, /^#endif.*\/\* *>>[a-z0-9_]+ *\*\//)) {
        row = $0
        sub(/^.*>>/, "", row)
        sub(/ .*$/, "", row)
        if (row != section) print "problem", NR, "#endif names >>" row " where >>" section " ends"
        close_span(NR)
    }
    code = strip($0)
    if (section == "") switches(code)
    identifiers(code)
    continued = code ~ /\\ *$/
    previous = $0
}
END {
    if (section != "") print "problem", NR, ">>" section ": no #endif /* >>" section " */"
    if (!over) print "problem", NR, "no #endif /* SPHPA_H */"
}
