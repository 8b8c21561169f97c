# tangle.awk: from a chapter, its program and all that the check needs.
#
#   awk -f tangle.awk -v out=FOLDER/NAME [-v header=sphpa.h] [-v most=250] tutorials/NAME.md
#
# Writes NAME.c (the c fences, named ones where they are pulled in, with #line, so that a compiler's
# message points at the Markdown line), NAME.gp (gnuplot fences), NAME.sh (sh fences), NAME.expect
# (output fences), NAME.text (text fences) and NAME.prose (numbers that the text states). Fences:
#   ```c                 appended to the program
#   ```c <<name>>=       a chunk that a line <<name>> of another fence pulls in
#   ```gnuplot           appended to the picture's script
#   ```sh                run by the check, in order
#   ```output [TOL]      must be printed, in order; numbers within a relative TOL (1e-9, less than a digit)
#   ```quote FILE NAME   must equal the text between /*[NAME]*/ and /*[/]*/ in FILE (the header)
#   ```text              shown, and no more
# What is wrong is said as FILE:LINE: on stderr, all of it, and the exit status is then 1.

function wrong(line, text) {
    printf "%s:%d: %s\n", FILENAME, line, text > "/dev/stderr"
    bad++
}

function put(text) { print text > program; }

# chunk k's lines from `from` on; a reference pulls in what it names, as deep as it stands
function emit(k, indent,    i, first, name, inner, line) {
    active[k] = 1
    first = 1
    for (i = 1; i <= lines[k]; i++) {
        line = text[k, i]
        if (line ~ /^[ \t]*<<[^<>]+>>[ \t]*$/) {
            name = line
            sub(/^[ \t]*<</, "", name)
            sub(/>>[ \t]*$/, "", name)
            match(line, /^[ \t]*/)
            inner = substr(line, 1, RLENGTH)
            if (!(name in chunk)) {
                wrong(at[k] + i, "there is no chunk <<" name ">>; define it with ```c <<" name ">>=")
                continue
            }
            used[name] = 1
            if (active[chunk[name]]) {
                wrong(at[k] + i, "chunk <<" name ">> contains itself")
                continue
            }
            emit(chunk[name], indent inner)
            first = 1
            continue
        }
        if (first) put("#line " (at[k] + i) " \"" FILENAME "\"")
        first = 0
        put(line == "" ? "" : indent line)
        total++
    }
    active[k] = 0
}

# the text between the marks in the header; -1 in found where there is none
function read_quote(file, name,    line, state, n) {
    state = 0
    n = 0
    while ((getline line < file) > 0) {
        if (state == 0 && index(line, "/*[" name "]*/")) { state = 1; continue }
        if (state == 1 && index(line, "/*[/]*/")) { state = 2; break }
        if (state == 1) quoted[++n] = line
    }
    close(file)
    return state == 2 ? n : -1
}

function check_quote(k,    n, i) {
    n = read_quote(header != "" ? header : quote_file[k], quote_name[k])
    if (n < 0) {
        wrong(at[k], quote_file[k] " has no /*[" quote_name[k] "]*/ .. /*[/]*/")
        return 0
    }
    for (i = 1; i <= n || i <= lines[k]; i++)
        if (i > n || i > lines[k] || quoted[i] != text[k, i]) {
            wrong(at[k] + i, "differs from " quote_file[k] ", which has: " (i > n ? "(no more)" : quoted[i]))
            return 0
        }
}

# a line without what stands between signs of that kind; one that is left open goes on in the next line
function without(sign, line,    kept, part, n, k) {
    n = split(line, part, sign)
    kept = ""
    for (k = 1; k <= n; k++) {
        kept = kept (open[sign] ? " " : part[k])
        if (k < n) open[sign] = !open[sign]
    }
    return kept
}

# numbers of a line of prose, without formulas, code, links and comments
function prose(line, number,    rest, n, before, after) {
    if (line ~ /^[ \t]*$/) open["`"] = open["[$]"] = 0
    line = without("[$]", without("`", line))
    gsub(/\]\([^)]*\)/, " ", line)
    gsub(/<!--[^>]*-->/, " ", line)
    gsub(/\((1[89]|20)[0-9][0-9][a-z]?\)/, " ", line)
    rest = line
    while (match(rest, /~?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?/)) {
        n = substr(rest, RSTART, RLENGTH)
        before = RSTART > 1 ? substr(rest, RSTART - 1, 1) : " "
        after = substr(rest, RSTART + RLENGTH)
        rest = after
        if (before ~ /[A-Za-z_.]/ || after ~ /^[A-Za-z_]/) continue
        if (n ~ /^(1[89]|20)[0-9][0-9]$/) continue
        if (n !~ /[.e]/ && length(n) < 3 && after !~ /^ ?%/) continue
        print number, n, (after ~ /^ ?%/ ? 1 : 0) > (out ".prose")
    }
}

BEGIN {
    program = out ".c"
    if (most == "") most = 250
    printf "" > program
    printf "" > (out ".gp")
    printf "" > (out ".sh")
    printf "" > (out ".expect")
    printf "" > (out ".prose")
    printf "" > (out ".text")
}

/^```/ && !inside {
    info = substr($0, 4)
    inside = NR
    at[++fences] = NR
    kind[fences] = info
    sub(/ .*/, "", kind[fences])
    n = split(info, word, " ")
    if (info ~ /^c <<[^<>]+>>=$/) {
        name = info
        sub(/^c <</, "", name)
        sub(/>>=$/, "", name)
        kind[fences] = "chunk"
        if (name in chunk) wrong(NR, "chunk <<" name ">> was defined before, in line " at[chunk[name]])
        else chunk[name] = fences
        names[fences] = name
    } else if (info ~ /^quote [^ ]+ [^ ]+$/) {
        quote_file[fences] = word[2]
        quote_name[fences] = word[3]
    } else if (info ~ /^output( [0-9.e-]+)?$/) {
        print "F\t" NR "\t" (n > 1 ? word[2] : "1e-9") > (out ".expect")
    } else if (info !~ /^(c|sh|gnuplot|text)$/)
        wrong(NR, "a fence \"" info "\" is none of: c, c <<name>>=, gnuplot, sh, output, quote FILE NAME, text")
    if (kind[fences] == "sh") print "at=" NR > (out ".sh")
    next
}
/^```[ \t]*$/ && inside { inside = 0; next }
inside {
    k = fences
    text[k, ++lines[k]] = $0
    if (kind[k] == "gnuplot") print > (out ".gp")
    if (kind[k] == "sh") print > (out ".sh")
    if (kind[k] == "text") print > (out ".text")
    if (kind[k] == "output") print "L\t" NR "\t" $0 > (out ".expect")
    next
}
/^\$\$/ { formula = !formula; next }
/^## / { references = /^## References/ }
!formula && !references && !/^#/ { prose($0, NR) }

END {
    if (inside) wrong(inside, "this fence is not closed")
    for (k = 1; k <= fences; k++) {
        if (kind[k] == "c") emit(k, "")
        if (kind[k] == "quote") check_quote(k)
    }
    for (k = 1; k <= fences; k++) # those that nothing reached may hide errors of their own
        if (kind[k] == "chunk" && !(names[k] in used)) {
            wrong(at[k], "chunk <<" names[k] ">> is never used")
            program = "/dev/null"
            emit(k, "")
        }
    if (total > most) wrong(1, "the program has " total " lines; at most " most)
    print total + 0 > (out ".lines")
    exit bad > 0
}
