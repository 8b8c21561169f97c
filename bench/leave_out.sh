#!/bin/sh
# leave_out.sh: builds one program a kind of scene, and one with all of them, runs them in turn and makes
# the table of what each kind costs: bytes a particle, time a step, stripped program, compile time, and
# the time that the same scene takes in the program that has everything. Writes leave_out.csv.
#   COMPILE, LINK   how to compile and link C (the Makefile gives them)
#   OUT             folder for programs and table (build/bench)
set -eu
cd "$(dirname "$0")/.."
rounds=5 particles=30000
number() { # number LOW HIGH OPTION VALUE..: is VALUE a whole number in that range?
    case ${4-} in
    '' | *[!0-9]*) ;;
    *) [ "${#4}" -le 9 ] && [ "$4" -ge "$1" ] && [ "$4" -le "$2" ] && return 0 ;;
    esac
    echo "leave_out: $3 ${4-}: give a whole number from $1 to $2" >&2
    exit 2
}
while [ $# -gt 0 ]; do
    case $1 in
    --rounds) number 1 1000 "$@" && rounds=$2 ;;
    --particles) number 1000 10000000 "$@" && particles=$2 ;;
    --help)
        cat << END
leave_out: what each kind of scene pays for

options [default]:
  --rounds N                   each program runs so often, in turn; medians are shown [$rounds]
  --particles N                of a scene, 1000 to 10000000 [$particles]
  --help                       this text
Writes build/bench/leave_out.csv. In five rounds some four minutes.
END
        exit 0 ;;
    *) echo "leave_out: $1: no such option; --help lists them" >&2 && exit 2 ;;
    esac
    shift 2
done
: "${OUT:=build/bench}" "${COMPILE:?run it with make leave-out}" "${LINK:=-lm}"
scenes='gas elastic solid pumice gsph'
work=$OUT/leave_out
mkdir -p "$work"
trap 'rm -f "$work/times" "$work/compiled" "$work/before"' EXIT

# computed: [s] that the children of this shell have computed
children() {
    times > "$work/before"
    computed=$(awk 'NR == 2 { split($1, u, /[ms]/); split($2, s, /[ms]/); print 60 * (u[1] + s[1]) + u[2] + s[2] }' \
        "$work/before")
}

: > "$work/compiled"
build() { # build NAME FLAGS
    echo "compiling $1" >&2
    children; before=$computed
    # shellcheck disable=SC2086 # words on purpose
    $COMPILE $2 bench/leave_out.c -o "$work/$1" $LINK
    children; after=$computed
    cp "$work/$1" "$work/$1.stripped" && strip "$work/$1.stripped"
    echo "$1 $(wc -c < "$work/$1.stripped") $before $after" >> "$work/compiled"
}

number=0
for scene in $scenes; do
    build $scene "-DLEAVE_OUT=$number"
    number=$((number + 1))
done
build all ''

: > "$work/times"
round=1
while [ $round -le "$rounds" ]; do
    for scene in $scenes; do
        echo "round $round of $rounds: $scene" >&2
        alone=$("$work/$scene" --particles "$particles")
        all=$("$work/all" --particles "$particles" --scene $scene)
        printf 'alone %s\nall %s\n' "$alone" "$all" >> "$work/times"
    done
    round=$((round + 1))
done

awk -v scenes="$scenes" '
    function median(key, count, k, j, t) { # of list[key, 1 .. count]
        for (k = 2; k <= count; k++)
            for (j = k; j > 1 && list[key, j] < list[key, j - 1]; j--) {
                t = list[key, j]; list[key, j] = list[key, j - 1]; list[key, j - 1] = t
            }
        return list[key, int((count + 1) / 2)]
    }
    FILENAME ~ /compiled$/ { size[$1] = $2; compile[$1] = $4 - $3; next }
    { bytes[$2] = $3; scratch[$2] = $4; list[$1 " " $2, ++seen[$1 " " $2]] = $5
      if ($1 == "all") list["ratio " $2, ++seen["ratio " $2]] = $5 / last; last = $5 }
    END {
        print "scene,bytes_per_particle,scratch_bytes_per_particle,ns_per_particle_and_step," \
              "stripped_bytes,compile_s,time_with_all_over_alone"
        count = split(scenes, name, " ")
        for (k = 1; k <= count; k++) {
            s = name[k]
            printf "%s,%d,%d,%.0f,%d,%.1f,%.3f\n", s, bytes[s], scratch[s], median("alone " s, seen["alone " s]),
                   size[s], compile[s], median("ratio " s, seen["ratio " s])
        }
        printf "all,,,,%d,%.1f,\n", size["all"], compile["all"]
    }' "$work/compiled" "$work/times" > "$OUT/leave_out.csv"
echo "# $particles particles, one thread, $COMPILE"
tr ',' '\t' < "$OUT/leave_out.csv" | awk -F '\t' '{ printf "%-9s%20s%28s%26s%16s%11s%26s\n", $1, $2, $3, $4, $5, $6, $7 }'
