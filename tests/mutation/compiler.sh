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
# shellcheck disable=SC2086 # OMNI_OPTIONS are words
exec $cache c++ -w $OMNI_OPTIONS "$@"
