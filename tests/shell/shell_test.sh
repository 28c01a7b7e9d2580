#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Completions and manual pages, by the shells and by groff: shell_test.sh SKELETEX WORK
# zsh and fish are asked where they are installed.
set -euo pipefail
program=$1 work=$2
failed=0
fail() {
  echo "$*" >&2
  failed=1
}
rm -rf "$work"
mkdir -p "$work/models"
cd "$work"
touch models/bear.off models/bear.skeleton.json "two words.off"
for shell in bash zsh fish; do "$program" completions $shell -o skeletex.$shell; done
"$program" manual -o man1

# bash: what it offers for the last word of a command line.
# shellcheck source=/dev/null
source ./skeletex.bash
offered() {
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  _skeletex
  printf '%s\n' "${COMPREPLY[@]}" | sort | tr '\n' ' '
}
expect() { # what, then the words
  local wanted=$1 got
  shift
  got=$(offered "$@")
  [ "$got" = "$wanted" ] || fail "bash: $* offers \"$got\", not \"$wanted\""
}
complete -p skeletex >/dev/null || fail "bash: nothing is registered for skeletex"
expect "pack pose-random " skeletex p
expect "--version " skeletex --v
expect "--method " skeletex encode models/bear.off --me
expect "hybrid spd vsm " skeletex encode models/bear.off --method ""
expect "vsm " skeletex encode --method v
expect "vsm " skeletex encode --method = v
expect "hybrid spd vsm " skeletex encode --method =
expect "models/bear.off models/bear.skeleton.json " skeletex encode models/
expect "models/bear.off models/bear.skeleton.json " skeletex encode models/bear.off -o models/
expect "two words.off " skeletex encode tw
expect " " skeletex encode --size ""
expect "smooth " skeletex filter m.skx.exr s
expect "smooth " skeletex filter -o x.ply m.skx.exr s
expect "smooth " skeletex filter --output = x.ply m.skx.exr s
expect "encode " skeletex help enc
expect "bash fish zsh " skeletex completions ""
expect "models " skeletex manual -o mod
for command in $("$program" completions bash | sed -n 's/.*compgen -W .\(.*\). -- .*/\1/p' | head -n 1); do
  case $command in -*) continue ;; esac
  "$program" help "$command" >help.txt || fail "help $command ends with $?"
  # Every option of its help is offered.
  for option in $(sed -n 's/^  \(-[a-zA-Z],\)\{0,1\}\(--[a-z-]*\).*/\2/p' help.txt); do
    case " $(offered skeletex "$command" "$option") " in *" $option "*) ;; *) fail "bash: $command $option is not offered" ;; esac
  done
  [ -s "man1/skeletex-$command.1" ] || fail "$command has no manual page"
done

if command -v zsh >/dev/null; then
  zsh -n skeletex.zsh || fail "zsh cannot read its completions"
else echo "zsh is not installed: its completions are not read"; fi
if command -v fish >/dev/null; then
  fish_offers() { # wanted, then the line
    local got
    got=$(fish --no-config -c "source skeletex.fish; complete -C '$2'" | cut -f 1 | sort | tr '\n' ' ')
    [ "$got" = "$1" ] || fail "fish: \"$2\" offers \"$got\", not \"$1\""
  }
  fish_offers "pack pose-random " "skeletex p"
  fish_offers "--method " "skeletex encode --meth"
  fish_offers "hybrid spd vsm " "skeletex encode models/bear.off --method "
  fish_offers "models/bear.off models/bear.skeleton.json " "skeletex encode models/"
  fish_offers "encode " "skeletex help enc"
else echo "fish is not installed: its completions are not read"; fi

# Manual pages: no warning of any kind, and the text of the help.
for page in man1/*.1; do
  warnings=$(LC_ALL=C.UTF-8 groff -man -Tutf8 -ww -z "$page" 2>&1) || fail "$page: groff fails"
  [ -z "$warnings" ] || fail "$page: $warnings"
done
text=$(groff -man -Tascii -P-c -P-b -P-o -P-u man1/skeletex-encode.1)
for part in "SKELETEX-ENCODE(1)" "skeletex encode MESH [SKELETON] -o FILE [OPTIONS]" "--method spd|vsm|hybrid" "Compact file" \
  "skeletex encode bear.off bear.skeleton.json -o bear.skx.exr"; do
  case $text in *"$part"*) ;; *) fail "the page of encode lacks \"$part\"" ;; esac
done
case $(groff -man -Tascii -P-c -P-b -P-o -P-u man1/skeletex.1) in *"skeletex-COMMAND"*) ;; *) fail "skeletex.1 does not point to the others" ;; esac
exit $failed
