#!/bin/sh
# SPDX-License-Identifier: MIT
# The C++ compiler for tests that build the firmware's sources themselves: takes $OMNI_CHANGED in place of $OMNI_ORIGINAL.
# A mutant's unused variable is no finding, so warnings are off.
count=$#
while [ "$count" -gt 0 ]; do
    word=$1
    shift
    [ "$word" != "$OMNI_ORIGINAL" ] || word=$OMNI_CHANGED
    set -- "$@" "$word"
    count=$((count - 1))
done
cache=$(command -v ccache)
eval "set -- $OMNI_OPTIONS \"\$@\"" # it holds words as a shell reads them
exec $cache c++ -w "$@"
