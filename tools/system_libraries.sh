#!/bin/sh
# The system libraries that Blender's Python module and headless OpenGL need on Debian and Ubuntu.
# Installed when root; named with the exact command otherwise. Other systems: nothing to do here.
set -eu
packages="libegl1 libgl1 libgl1-mesa-dri libxkbcommon0 libxi6 libxxf86vm1 libxfixes3 libxrender1 libsm6"
command -v dpkg-query >/dev/null 2>&1 || exit 0
missing=""
for package in $packages; do
    # shellcheck disable=SC2016 # the dollar belongs to dpkg-query
    state=$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)
    [ "$state" = "install ok installed" ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
if [ "$(id -u)" = 0 ]; then
    echo "installing$missing"
    apt-get update -q
    # shellcheck disable=SC2086 # one argument a package
    DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing
else
    echo "error: system libraries are missing; run: sudo apt-get install$missing" >&2
    exit 1
fi
