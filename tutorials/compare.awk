# compare.awk: was printed what the chapter says, and does its text state no other number?
#
#   awk -f compare.awk -v chapter=tutorials/NAME.md NAME.expect NAME.prose [NAME.c] NAME.out
#
# The lines of an output fence must stand in NAME.out one after the other (a line ... skips any
# number), the fences in their order. Numbers may differ by the fence's relative tolerance; one that
# is written ~1.2 may be any number. A number that the prose states must occur in a fence, rounded to
# as many digits (times 100 before a % sign; a ~ belongs to a ~).

function say(line, what) {
    printf "%s:%d: %s\n", chapter, line, what > "/dev/stderr"
    bad++
}

# words and numbers of a line: piece[1..n], returned
function split_line(line, piece,    n, rest, before, number, start) {
    n = 0
    gsub(/[ \t]+/, " ", line)
    sub(/^ /, "", line)
    sub(/ $/, "", line)
    before = " "
    while (match(line, /~?[-+]?[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?/)) {
        start = RSTART
        number = substr(line, start, RLENGTH)
        rest = substr(line, start + RLENGTH)
        if (start > 1) before = substr(line, start - 1, 1)
        if (number ~ /^[-+]/ && before !~ /[ =(,:[|]/) { # a hyphen, not a sign
            number = substr(number, 2)
            start++
        }
        piece[++n] = substr(line, 1, start - 1)
        piece[++n] = number
        before = substr(number, length(number), 1)
        line = rest
    }
    piece[++n] = line
    return n
}

# "" where the lines agree, else what does not
function differs(want, got, tol,    a, b, n, m, k, x, y) {
    n = split_line(want, a)
    m = split_line(got, b)
    if (n != m) return "other words"
    for (k = 1; k <= n; k++) {
        if (k % 2) {
            if (a[k] != b[k]) return "other words"
            continue
        }
        if (a[k] ~ /^~/) continue
        sub(/^~/, "", b[k])
        x = a[k] + 0
        y = b[k] + 0
        if (x != y && !((x > y ? x - y : y - x) <= tol * (x < 0 ? -x : x)))
            return "the text has " a[k] ", printed is " b[k]
    }
    return ""
}

# does fence f stand in the output from line p on? the end of it, or 0; best: where it broke
function matches(f, p,    k, q, why, loose) {
    q = p
    loose = 0
    for (k = 1; k <= size[f]; k++) {
        if (want[f, k] ~ /^ *\.\.\. *$/) { loose = 1; continue }
        while (1) {
            why = q <= printed ? differs(want[f, k], got[q], tol[f]) : "the end of what was printed"
            if (why == "") break
            if (!loose || q > printed) {
                score = 2 * k + (why != "other words" && q <= printed)
                if (score > best) {
                    best = score
                    best_line = k
                    best_why = why
                    best_got = q <= printed ? got[q] : ""
                }
                return 0
            }
            q++
        }
        loose = 0
        q++
    }
    return q
}

function check_fence(f,    p, end) {
    best = -1
    for (p = position; p <= printed + (size[f] == 0); p++) {
        end = matches(f, p)
        if (end) { position = end; return 1 }
    }
    if (best < 0) { best_line = 1; best_why = "the end of what was printed"; best_got = "" }
    say(line_of[f, best_line], "not printed: " want[f, best_line] \
        (best_got != "" && best_why != "other words" ? "\n    printed: " best_got "\n    " best_why : ""))
    return 0
}

function remember(line, from_output,    a, n, k, key) {
    n = split_line(line, a)
    for (k = 2; k <= n; k += 2) {
        if (!from_output && a[k] ~ /^~/) continue
        sub(/^[-+]/, "", a[k])
        key = a[k] (a[k + 1] ~ /^ ?%/ ? "%" : "")
        if (key in known) continue
        known[key] = 1
        pool[++pooled] = a[k]
        share[pooled] = key ~ /%$/ || a[k] ~ /[.e]/ # a bare 3 is no 3 %
    }
}

function check_prose(line, number, percent,    value, unit, k, x, digits, exponent, approximate, mantissa) {
    approximate = number ~ /^~/
    sub(/^~/, "", number)
    mantissa = number
    exponent = 0
    if (mantissa ~ /e/) {
        exponent = mantissa
        sub(/^[^e]*e/, "", exponent)
        sub(/e.*/, "", mantissa)
    }
    digits = index(mantissa, ".") ? length(mantissa) - index(mantissa, ".") : 0
    unit = 0.5001 * ("1e" (exponent - digits))
    value = number + 0
    for (k = 1; k <= pooled; k++) {
        x = pool[k]
        if ((x ~ /^~/) != approximate) continue
        sub(/^~/, "", x)
        if (percent && !share[k]) continue
        if (close_to(x, value, unit) || (percent && close_to(100 * x, value, unit))) return
    }
    say(line, "the text states " (approximate ? "~" : "") number (percent ? " %" : "") ", which no fence has")
}
function close_to(x, value, unit) { return x - value <= unit && value - x <= unit }

FNR == 1 { file++; name = FILENAME }
name ~ /\.expect$/ {
    split($0, part, "\t")
    if (part[1] == "F") { tol[++fences] = part[3]; size[fences] = 0; fence_at[fences] = part[2] }
    else {
        want[fences, ++size[fences]] = substr($0, length(part[2]) + 4)
        line_of[fences, size[fences]] = part[2]
        remember(want[fences, size[fences]], 1)
    }
    next
}
name ~ /\.prose$/ { prose_line[++stated] = $1; prose_number[stated] = $2; prose_percent[stated] = $3; next }
name ~ /\.out$/ { got[++printed] = $0; next }
!/^#line/ { remember($0, 0) }

END {
    position = 1
    for (f = 1; f <= fences; f++) if (!check_fence(f)) break
    for (k = 1; k <= stated; k++) check_prose(prose_line[k], prose_number[k], prose_percent[k])
    compared = 0
    for (f = 1; f <= fences; f++)
        for (k = 1; k <= size[f]; k++) compared += int(split_line(want[f, k], piece) / 2)
    printf "%d\n", compared
    exit bad > 0
}
