#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Holds the code against the project's rules: clang-format, the sizes of files and folders, the way of includes, and
# clang-tidy's checks (.clang-tidy) over a build made by `cmake --preset release`. Ends with 1 and names each place that
# breaks a rule.
#
#   scripts/lint.sh            everything
#   scripts/lint.sh FILE...    clang-tidy on these sources alone
set -euo pipefail
cd "$(dirname "$0")/.."
status=0

mapfile -t sources < <(git ls-files '*.h' '*.cpp' '*.cl')
clang-format --dry-run --Werror "${sources[@]}" || status=1

for file in "${sources[@]}"; do
  case $file in core/* | kernels/*) ;; *) continue ;; esac
  lines=$(wc -l <"$file")
  [ "$lines" -le 500 ] || { echo "$file: $lines lines; split it (at most 500)" >&2; status=1; }
done
for ending in h cpp; do
  while read -r count folder; do
    [ "$count" -le 14 ] || { echo "$folder: $count .$ending files; make folders by meaning (at most 14)" >&2; status=1; }
  done < <(git ls-files "core/**/*.$ending" | xargs -n 1 dirname | sort | uniq -c)
done

# Includes go one way between groups of folders (CONTRIBUTING.md).
git grep -o '#include "skeletex/[^"]*' -- core/skeletex | awk -F '[:"]' '
  function folder(path, parts) { split(path, parts, "/"); return parts[1] == "compact" && parts[2] == "encode" ? "compact/encode" : parts[1] }
  BEGIN {
    count = split("math,geometry,skeleton,model,device compact,io,reconstruct,convert,analysis,edit render,compact/encode skeletonize close rig page", groups, ",")
    for (i = 1; i <= count; ++i) { n = split(groups[i], names, " "); for (k = 1; k <= n; ++k) rank[names[k]] = i }
  }
  {
    from = folder(substr($1, length("core/skeletex/") + 1)); to = folder(substr($3, length("skeletex/") + 1))
    for (i = 0; i < 2; ++i) if (!((i ? to : from) in rank)) { print $1 ": no group has the folder " (i ? to : from); bad = 1 }
    if (rank[to] > rank[from] && $3 != "skeletex/model/error.h") { print $1 ": " from " includes " $3; bad = 1 }
  }
  END { exit bad }' >&2 || status=1

# The linker takes the functions of two types of one name for the same.
doubles=$(git ls-files 'core/**/*.h' | xargs grep -hoE '^(struct|class) \w+ *(final *)?[:{]' | awk '{print $2}' | sort | uniq -d)
[ -z "$doubles" ] || { echo "two types are called" $doubles >&2; status=1; }

# Each entry of a docstring has a line of its own, also after clang-format has filled lines.
! grep -nE '///<? .*\S.*\\(param|returns?|throws?|pre)\b|///.*\\(param|return|throw|pre)\s*$' $(git ls-files 'c*/*.h' 'c*/*.cpp') || status=1

if [ $# -gt 0 ]; then
  checked=("$@")
else
  mapfile -t checked < <(git ls-files 'core/*.cpp' 'cli/*.cpp' 'experiments/*.cpp' 'python/*.cpp')
fi
printf '%s\0' "${checked[@]}" | xargs -0 -n 4 -P "$(nproc)" clang-tidy -p build/release --quiet 2> >(grep -v 'warnings\? \(generated\|treated\)' >&2) || status=1
exit "$status"
