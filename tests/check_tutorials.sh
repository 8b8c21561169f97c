#!/bin/sh
# check_tutorials.sh: the tools of the book on small chapters that are right and wrong: what each mistake
# makes them say, and in which line of the Markdown. (The chapters themselves: make tutorials.)
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

# a project of one chapter, with a header of two lines
root=$work/root
mkdir -p "$root/tutorials/answers" "$root/tutorials/img"
cp tutorials/tangle.awk tutorials/compare.awk tutorials/check.sh "$root/tutorials/"
printf '/* a header */\n#define ONE 1\n/*[two]*/\n#define TWO 2\n/*[/]*/\n' > "$root/sphpa.h"
: > "$root/tutorials/img/01_small.svg"
printf '## 1\n\n## 2\n\n```sh\necho "again 5"\n```\n\n```output\nagain 5\n```\n\n## 3\n' > "$root/tutorials/answers/01_small.md"

cat > "$work/good.md" <<'END'
# 1. Small

It prints 2.50 and, of its share, 25 %; $7.77$ and `8.88` are not looked at, nor is $9.99 +
9.98$ over two lines.

```c
#include <stdio.h>
#include "sphpa.h"
```

```quote sphpa.h two
#define TWO 2
```

```c <<body>>=
    printf("a value %.3f\n", 2.5);
    <<more>>
```

```c <<more>>=
printf("noise %d\n", ONE);
printf("share 0.25, took %.1f s\n", 0.1 * TWO);
printf("skipped\nlast -1.5e-3 10^-3\n");
```

```c
int main(void) {
    <<body>>
    return 0;
}
```

```sh
cc -O1 -I. 01_small.c -o 01_small -lm
./01_small
gnuplot 01_small.gp
```

```output 1e-2
a value 2.51
```

```output
share 0.25, took ~7 s
...
last -1.5e-3 10^-3
```

```gnuplot
set terminal svg
set output '01_small.svg'
plot x
```

![A picture](img/01_small.svg)

## Exercises

[answers](answers/01_small.md)

## What the library does more

## References

- Somebody 1962, eq. 12.345
END

chapter() { # run the check on what stands in the chapter now: $status, files stdout and stderr
    (cd "$root" && BUILD=build sh tutorials/check.sh 01_small) > "$work/stdout" 2> "$work/stderr" < /dev/null
    status=$?
}
good() { # good WHAT
    chapter
    [ "$status" = 0 ] && grep -q '^ok tutorials/01_small.md: 9 lines' "$work/stdout" && return
    failed "$1: exit status $status"
    cat "$work/stdout" "$work/stderr"
}
# wrong LINE PATTERN WHAT: it must fail and say so, in that line of the Markdown
wrong() {
    chapter
    [ "$status" = 1 ] || failed "$3: exit status $status, not 1"
    grep -q "^tutorials/01_small.md:$1:.*$2" "$work/stderr" ||
        { failed "$3: not said as :$1: .. $2; said:"; head -n 5 "$work/stderr"; }
    grep -q '^FAILED tutorials/01_small.md' "$work/stderr" || failed "$3: no last line FAILED"
    mistakes=$((mistakes + 1))
}
mistakes=0
# spoil SED_SCRIPT: the chapter with an edit (which must change something)
spoil() {
    sed "$1" "$work/good.md" > "$root/tutorials/01_small.md"
    cmp -s "$work/good.md" "$root/tutorials/01_small.md" && failed "the edit $1 changes nothing"
}

cp "$work/good.md" "$root/tutorials/01_small.md"
good 'a chapter that is right'

# ---- the tangler ----
spoil 's/^    <<body>>$/    <<bodi>>/'
wrong 28 'no chunk <<bodi>>' 'an unknown chunk'
wrong 15 'chunk <<body>> is never used' 'an unused chunk'
spoil 's/^printf("noise.*/<<body>>/'
wrong 21 'chunk <<body>> contains itself' 'a cycle of chunks'
spoil 's/<<more>>=/<<body>>=/'
wrong 20 'chunk <<body>> was defined before, in line 15' 'a chunk that is defined twice'
spoil 's/^```c <<more>>=/```d/'
wrong 20 'a fence "d" is none of' 'an unknown fence'
spoil '/^- Somebody/s/^/```c\
/'
wrong 65 'not closed' 'a fence that is not closed'
spoil 's/^#define TWO 2/#define TWO 3/'
wrong 12 'differs from sphpa.h, which has: #define TWO 2' 'a quote that differs'
spoil 's/quote sphpa.h two/quote sphpa.h tow/'
wrong 11 'sphpa.h has no .*tow' 'a quote of nothing'
awk '{ print } /<<body>>$/ { for (k = 0; k < 250; k++) print "    (void)0;" }' "$work/good.md" > "$root/tutorials/01_small.md"
wrong 1 'the program has 259 lines; at most 250' 'a program that is too long'

# ---- the compiler's and the program's own lines ----
spoil 's/printf("noise %d/oops; printf("noise %d/'
wrong 21 '.*error' 'an error of the compiler in a chunk'
spoil 's/return 0;/return 0 + nothing;/'
wrong 29 '.*error' "an error of the compiler after a chunk"
spoil 's/^    return 0;/    return __LINE__ - 31;/'
wrong 33 'a command of this fence failed' 'a program that fails'

# ---- the comparison ----
spoil 's/took ~7 s/took 7 s/'
wrong 44 'not printed: share 0.25, took 7 s' 'a number that differs'
spoil 's/a value 2.51/a value 2.53/'
wrong 40 'not printed: a value 2.53' 'a number beyond the tolerance'
spoil 's/^share 0.25/shard 0.25/'
wrong 44 'not printed: shard' 'a word that differs'
spoil 's/^last -1.5e-3/last 1.5e-3/'
wrong 46 'not printed: last 1.5e-3' 'a sign that differs'
spoil 's/^last .*/skipped/'
good 'the line that was skipped'
spoil 's/^skipped/skipped/; s/^\.\.\.$/noise 1/'
wrong 45 'not printed: noise 1' 'lines in another order'
spoil 's/prints 2.50/prints 2.60/'
wrong 3 'the text states 2.60, which no fence has' 'a number of the text that no fence has'
spoil 's/share, 25 %/share, 26 %/'
wrong 3 'the text states 26 %' 'a share of the text that no fence has'
spoil 's/prints 2.50/prints ~2.50/'
wrong 3 'the text states ~2.50' 'a number of the machine that no fence has'

# ---- what a chapter must have ----
missing() { # missing PATTERN WHAT
    chapter
    [ "$status" = 1 ] && grep -q "$1" "$work/stderr" && { mistakes=$((mistakes + 1)); return; }
    failed "$2: exit status $status, and not said: $1; said:"
    head -n 5 "$work/stderr"
}
spoil 's/^## Exercises/## Tasks/'
missing 'no section "## Exercises"' 'no exercises'
spoil 's/img.01_small.svg/img\/01_other.svg/'
if have gnuplot; then missing 'img/01_other.svg, which the fences do not draw' 'a picture that nobody draws'
else skip 'pictures of chapters' 'no gnuplot'; fi
cp "$work/good.md" "$root/tutorials/01_small.md"
sed -i.before 's/^again 5/again 6/' "$root/tutorials/answers/01_small.md"
chapter
grep -q '^tutorials/answers/01_small.md:10: not printed: again 6' "$work/stderr" || failed 'a wrong answer: not said'
printf '## 1\n' > "$root/tutorials/answers/01_small.md"
missing 'must answer three exercises' 'an answer that is missing'

# ---- a real chapter against a header with another formula ----
cp -r tutorials/01_kernels.md tutorials/img "$root/tutorials/"
cp tutorials/answers/01_kernels.md "$root/tutorials/answers/"
sed 's/\(sphpa_kernel_cubic_w_(double q) {\)/\1 q *= 1.0000001;/' "$HEADER" > "$root/sphpa.h"
cmp -s "$HEADER" "$root/sphpa.h" && failed 'the edit of the header changes nothing'
(cd "$root" && BUILD=build sh tutorials/check.sh 01_kernels) > "$work/stdout" 2> "$work/stderr" < /dev/null &&
    failed 'chapter 1 does not notice another kernel in the header'
line=$(grep -n 'CHECK(library < 1e-12)' tutorials/01_kernels.md | cut -d : -f 1)
grep -q "^tutorials/01_kernels.md:$line: does not hold: library < 1e-12" "$work/stderr" ||
    { failed 'chapter 1 does not name the line that notices another kernel:'; head -n 5 "$work/stderr"; }
finish "$mistakes mistakes in a chapter, each told with its line"
