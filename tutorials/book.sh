#!/bin/sh
# book.sh: the book as a site, BUILD/book/index.html: pages made by pandoc, formulas as MathML, nothing
# from the network. BUILD (build). Checks that every link and picture of the pages leads somewhere.
set -eu
: "${BUILD:=build}"
site=$BUILD/book
rm -rf "$site"
mkdir -p "$site/answers"
cp -r tutorials/img tutorials/style.css sphpa.h "$site/"
font=$(find /usr/share /usr/local/share -name latinmodern-math.otf 2> /dev/null | head -n 1)
if [ -n "$font" ]; then cp "$font" "$site/"; fi

title() { sed -n 's/^# //p' "$1" | head -n 1; }
chapters=$(ls tutorials/[0-9][0-9]_*.md)
list() { # list TOP HERE: the column of chapters, HERE the page that it stands on
    echo '<ol>'
    for file in $chapters; do
        name=$(basename "$file" .md)
        if [ "$name" = "$2" ]; then echo "<li class=\"here\">$(title "$file")</li>"
        else echo "<li><a href=\"$1$name.html\">$(title "$file")</a></li>"; fi
    done
    echo '</ol>'
}
# page FILE OUT TOP [VARIABLES..]
page() {
    file=$1 out=$2 top=$3
    shift 3
    echo "book: $out" >&2
    pandoc --fail-if-warnings -f gfm+tex_math_dollars+implicit_figures -t html5 --standalone --mathml --highlight-style=tango \
        --lua-filter=tutorials/book.lua --template=tutorials/book.html \
        -V top="$top" -V chapters="$(list "$top" "$(basename "$out" .html)")" --metadata pagetitle="$(title "$file")" \
        "$@" "$file" -o "$site/$out"
}

page tutorials/README.md index.html ''
before='' before_title='' pages=1
for file in $chapters; do
    name=$(basename "$file" .md)
    after=$(echo "$chapters" | awk -v here="$file" 'found { print; exit } $0 == here { found = 1 }')
    set --
    [ -n "$before" ] && set -- "$@" -V before="$before" -V before-title="$before_title"
    [ -n "$after" ] && set -- "$@" -V after="$(basename "$after" .md).html" -V after-title="$(title "$after")"
    page "$file" "$name.html" '' "$@"
    page "tutorials/answers/$name.md" "answers/$name.html" ../
    before=$name.html before_title=$(title "$file") pages=$((pages + 2))
done

# every href and src, but for the web's: FILE LINK
links=$(cd "$site" && for page in *.html answers/*.html; do
    grep -o '\(href\|src\)="[^"]*"' "$page" | sed -e 's/^[a-z]*="//' -e 's/"$//' -e "s|^|$page |"
done | grep -v ' https\?:' | sort -u)
echo "$links" | (cd "$site" && dead=0
while read -r page link; do
    file=${link%%#*} anchor=${link#"${link%%#*}"}
    file=$(dirname "$page")/$file
    [ "${link%%#*}" = '' ] && file=$page
    if ! [ -f "$file" ]; then echo "dead link in $page: $link" >&2; dead=1
    elif [ -n "$anchor" ] && ! grep -q "id=\"${anchor#\#}\"" "$file"; then echo "no such place in $page: $link" >&2; dead=1; fi
done
exit "$dead")
echo "book: $pages pages, $(echo "$links" | wc -l | tr -d ' ') links, none dead: $site/index.html"
