#!/bin/sh
# check.sh NAME: tangles, builds and runs chapter NAME (01_kernels) and compares what it prints.
#
# BUILD (build), CC (cc), EXTRA_CFLAGS; FIGURES=1: its pictures go to tutorials/img. Says one line when
# all holds; else what is wrong, with the Markdown line, and exits with 1. Works in
# BUILD/tutorials/NAME, as a reader would in a folder with nothing but sphpa.h.
set -u
: "${BUILD:=build}" "${CC:=cc}" "${EXTRA_CFLAGS:=}"
name=$1
chapter=tutorials/$name.md
folder=$BUILD/tutorials/$name
out=$folder/$name
number=${name%%_*}
[ -f "$chapter" ] || { echo "there is no $chapter" >&2; exit 1; }
rm -rf "$folder"
mkdir -p "$folder"
cp sphpa.h "$folder/" || exit 1

# run OUT FILE: the sh fences, OUT.sh, in the folder, output to OUT.out; on failure the line in FILE
run() {
    {
        echo "cc() { command $CC $EXTRA_CFLAGS \"\$@\"; }"
        command -v gnuplot > /dev/null 2>&1 || echo 'gnuplot() { :; }'
        echo 'trap '\''[ $? = 0 ] || { echo "'"$2"':$at: a command of this fence failed" >&2; exit 1; }'\'' EXIT'
        echo 'set -e'
        cat "$1.sh"
    } > "$1.run"
    (cd "$folder" && sh "${1##*/}.run") > "$1.out"
}

# a program that every compiler takes: as C11, without a warning
strict() {
    $CC -std=c11 -fsyntax-only -Wall -Wextra -Wpedantic -Wshadow -Wundef -Werror -I. "$1"
}

# pictures that the text shows must be drawn by the script
pictures() {
    command -v gnuplot > /dev/null 2>&1 || return 0
    sed -n 's/.*](img\/\([^)]*\)).*/\1/p' "$chapter" | while read -r picture; do
        [ -s "$folder/$picture" ] || echo "$chapter: the text shows img/$picture, which the fences do not draw"
        [ "$(wc -c < "$folder/$picture")" -lt 150000 ] || echo "$chapter: $picture has 150 kB or more"
        [ -f "tutorials/img/$picture" ] || echo "$chapter: there is no tutorials/img/$picture: make figures"
    done
}

# what every chapter has
parts() {
    for part in Exercises 'What the library does more' References; do
        grep -q "^## $part" "$chapter" || echo "$chapter: no section \"## $part\""
    done
    grep -q '](img/' "$chapter" || echo "$chapter: no picture"
    grep -q "](answers/$name.md)" "$chapter" || echo "$chapter: no link to answers/$name.md"
    [ "$(grep -c '^## ' "tutorials/answers/$name.md" 2> /dev/null)" = 3 ] ||
        echo "tutorials/answers/$name.md: must answer three exercises, one under each ##"
}

cpu() { # tenths of a second of all that was run before `times > FILE` (which a subshell would not know)
    awk 'NR == 2 { gsub(/[ms]/, " "); print int(10 * (60 * $1 + $2 + 60 * $3 + $4)) }' "$folder/times"
}
fail() { [ -z "$1" ] || echo "$1" >&2; echo "FAILED $chapter (what it printed: $folder/*.out)" >&2; exit 1; }
# holds FILE OUT: its fences tangled, built, run and compared; how many numbers in OUT.compared
holds() {
    awk -f tutorials/tangle.awk -v out="$2" -v header=sphpa.h "$1" || fail ''
    [ -s "$2.c" ] && { strict "$2.c" || fail ''; }
    run "$2" "$1" || fail ''
    awk -f tutorials/compare.awk -v chapter="$1" "$2.expect" "$2.prose" "$2.text" "$out.c" "$2.sh" "$2.out" \
        > "$2.compared" || fail ''
    times > "$folder/times"
}
holds "$chapter" "$out"
taken=$(cpu)
if [ -n "${FIGURES:-}" ]; then cp "$folder/$number"_*.svg "$folder/$number"_*.png tutorials/img/ 2> /dev/null; fi
wrong=$(parts; pictures)
[ -z "$wrong" ] || fail "$wrong"

# the answers use the chapter's program, by sh and output fences of their own
answers=$folder/answers
holds "tutorials/answers/$name.md" "$answers"
all=$(cpu)
printf 'ok %s: %s lines, %s.%s s of CPU, with its answers %s.%s s; %s numbers as in the text\n' \
    "$chapter" "$(cat "$out.lines")" $((taken / 10)) $((taken % 10)) $((all / 10)) $((all % 10)) \
    $(($(cat "$out.compared") + $(cat "$answers.compared")))
