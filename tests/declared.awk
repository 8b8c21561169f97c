# declared.awk -v file=sphpa.h: reads the output of `cc -E` and prints what that file declares at file
# scope, one record a line:  KIND IDENT LINE  with KIND one of
#   prototype, body (functions)   type (typedef or tag)   constant (of an enum)   object
# After the preprocessor, so that names made by ## and X-macros are seen as the compiler sees them.

function forget() { n = 0; parens = 0; kind = "" }

function report(what, name) { if (name ~ /^[A-Za-z_]/) print what, name, line }

# takes out __attribute__((..)), __asm__(..), __extension__ and the like
function tidy(    i, m, depth_) {
    m = 0
    for (i = 1; i <= n; i++) {
        if (word[i] ~ /^(__attribute__|__attribute|__asm__|__asm|asm|__declspec|_Pragma|__pragma)$/) {
            depth_ = 0
            while (++i <= n) {
                if (word[i] == "(") depth_++
                if (word[i] == ")" && --depth_ == 0) break
            }
        } else if (word[i] !~ /^(__extension__|__inline|__inline__|inline|_Noreturn|__restrict__)$/) {
            word[++m] = word[i]
        }
    }
    n = m
}

function function_name(    i) { # the first name that a parenthesis follows
    for (i = 1; i < n; i++) if (word[i + 1] == "(" && word[i] ~ /^[A-Za-z_]/) return word[i]
    return ""
}

function has(token,    i) {
    for (i = 1; i <= n; i++) if (word[i] == token) return i
    return 0
}

function statement(    i, end) { # ended by a semicolon at file scope
    tidy()
    if (n == 0) return
    if (word[1] == "typedef") {
        for (i = 1; i + 2 <= n; i++)
            if (word[i] == "(" && word[i + 1] == "*") { report("type", word[i + 2]); return }
        end = has("[") ? has("[") - 1 : n
        report("type", word[end])
    } else if (has("(") && !has("=")) {
        report("prototype", function_name())
    } else if (word[1] ~ /^(struct|union|enum)$/ && (n == 2 || word[n] == "}")) {
        if (n == 2) report("type", word[2])
    } else {
        end = has("=") ? has("=") - 1 : n
        if (has("[") && has("[") - 1 < end) end = has("[") - 1
        report("object", word[end])
    }
}

function opens(    i) { # a brace at file scope: of what?
    for (i = n; i >= 1 && i >= n - 1; i--)
        if (word[i] ~ /^(struct|union|enum)$/) {
            if (i < n) report("type", word[n])
            return word[i] == "enum" ? "enum" : "aggregate"
        }
    if (has("=")) return "initialiser"
    tidy()
    report("body", function_name())
    return "function"
}

function token(t) {
    if (depth == 0) {
        if (t == "{") {
            if (n == 1 && word[1] == "extern") { forget(); return } # extern "C": stays open
            kind = opens()
            depth = 1
            expect = 1
        } else if (t == ";") {
            statement()
            forget()
        } else if (t != "}") {
            word[++n] = t
        }
        return
    }
    if (kind == "enum" && depth == 1) {
        if (expect && t ~ /^[A-Za-z_]/) { report("constant", t); expect = 0 }
        if (t == "," && parens == 0) expect = 1
    }
    if (t == "(") parens++
    if (t == ")") parens--
    if (t == "{") depth++
    if (t == "}" && --depth == 0) {
        if (kind == "function") forget()
        else word[++n] = "}"
    }
}

/^# *[0-9]+ *"/ || /^#line/ {
    line = $2 + 0
    name = $0
    sub(/^[^"]*"/, "", name)
    sub(/".*$/, "", name)
    sub(/^.*\//, "", name)
    inside = name == file
    next
}
inside && !/^ *#/ {
    gsub(/"([^"\\]|\\.)*"/, " ")
    gsub(/'([^'\\]|\\.)*'/, "0")
    text = $0
    while (match(text, /[A-Za-z_][A-Za-z0-9_]*|[^ \t]/)) {
        token(substr(text, RSTART, RLENGTH))
        text = substr(text, RSTART + RLENGTH)
    }
}
{ line++ }
