#!/usr/bin/env bash
# Makes a site of the documentation: every page that docs/SUMMARY.md lists as HTML, with the contents beside it. rustdoc renders the pages, so
# that nothing has to be installed beside the toolchain, and no network is there. The program runs the commands of docs/gallery.md, and the pages
# that they write are shown there.
#
#   bash docs/site/build.sh [FOLDER]      by default target/site; begin with index.html
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
site=$(realpath -m "${1:-target/site}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The page's name on the site: README.md is its beginning, datasets/README.md becomes scenes.html, docs/NAME.md NAME.html.
page_name() {
    case $1 in
        ../README.md) echo index ;;
        ../datasets/README.md) echo scenes ;;
        *) basename "$1" .md ;;
    esac
}

mapfile -t pages < <(sed -n 's/^- \[.*\](\(.*\))$/\1/p' docs/SUMMARY.md)
[ ${#pages[@]} -gt 10 ]

declare -A names
for page in "${pages[@]}"; do names[$(realpath --relative-to=. "docs/$page")]=$(page_name "$page").html; done

# links FILE: expressions for sed that turn each link of that page into one within the site. Pages become HTML; what is no page, sources and
# figures, is copied.
links() {
    local link target
    { grep -oE '\]\([^)#: ]+[)#]' "$1" || true; } | sed 's/^](//; s/.$//' | sort -u | while read -r link; do
        target=$(realpath -m --relative-to=. "$(dirname "$1")/$link")
        if [ -n "${names[$target]:-}" ]; then
            echo "s%]($link\([)#]\)%](${names[$target]}\1%g"
        elif [ -e "$target" ]; then
            mkdir -p "$site/source/$(dirname "$target")"
            cp -r "$target" "$site/source/$(dirname "$target")/"
            echo "s%]($link\([)#]\)%](source/$target\1%g"
        else
            echo "$1: the link $link leads nowhere" >&2
            return 1
        fi
    done
}

mkdir -p "$site/gallery"
cp docs/site/style.css "$site/"
program=$({ ls -t target/release/haptize target/debug/haptize 2>/dev/null || true; } | head -n 1)
[ -n "$program" ] || { cargo build --locked --quiet && program=target/debug/haptize; }
sed -n '/^```sh$/,/^```$/{/^```/d;p}' docs/gallery.md > "$work/gallery.sh"
(export PATH=$PWD/$(dirname "$program"):$PATH && cd "$work" && bash -e gallery.sh >gallery.log 2>&1) || { cat "$work/gallery.log"; exit 1; }
cp "$work"/*.html "$site/gallery/"
# with_frames FILE: the page with each page that a command of it wrote below the command.
with_frames() {
    awk '{ print } match($0, /--html [a-z]+\.html/) { page = substr($0, RSTART + 7, RLENGTH - 7) }
        /^```$/ && page { print "\n<iframe src=\"gallery/" page "\" title=\"" page "\"></iframe>\n\n[Open the page](gallery/" page ")"; page = "" }' "$1"
}
{
    echo '<div class="page"><nav>'
    sed -n -e 's#^\#\# \(.*\)#<h2>\1</h2>#p' -e 's#^- \[\(.*\)\](\(.*\))$#<a href="\2">\1</a>#p' docs/SUMMARY.md |
        sed -e 's#"\.\./README\.md"#"index.html"#' -e 's#"\.\./datasets/README\.md"#"scenes.html"#' -e 's#\.md"#.html"#'
    echo '</nav><main>'
} > "$work/before.html"
echo '</main></div>' > "$work/after.html"
for page in "${pages[@]}"; do
    name=$(page_name "$page")
    links "docs/$page" > "$work/links.sed"
    sed -f "$work/links.sed" "docs/$page" | with_frames - > "$work/$name.md"
    rustdoc --edition 2024 --markdown-no-toc --markdown-css style.css --html-before-content "$work/before.html" \
        --html-after-content "$work/after.html" -o "$site" "$work/$name.md"
done
echo "${#pages[@]} pages in $site; begin with index.html"
