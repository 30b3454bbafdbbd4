#!/usr/bin/env bash
# Runs a real Blender application: with its windows, and in the background.
#
#   tests/app/application.sh blender ARGUMENTS...   Blender without a window system
#   tests/app/application.sh window ARGUMENTS...    Blender in a window; on a virtual screen where
#                                                   there is no DISPLAY
#   tests/app/application.sh run COMMAND...         anything else beside it (`import` of ImageMagick)
#   tests/app/application.sh remove                 delete the folder that was made
#
# Which Blender:
#   BLENDER=/path/to/blender   your own, on any system; it needs Xvfb for `window` without a DISPLAY.
#   otherwise                  as root on Debian or its kin, the newest one of Debian, in a folder of its
#                              own that nothing else sees: $SPECTRAL_BOOTH_APP_ROOT, or .blender-app in the
#                              project. It is made at the first call (a few minutes, 2.5 GB), from the
#                              mirror that this machine's apt uses.
# The current folder is the only one that Blender sees under the same path there: keep files below it.
set -euo pipefail

project=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
root=${SPECTRAL_BOOTH_APP_ROOT:-$project/.blender-app}
packages=(blender xvfb imagemagick libegl1 libgl1 libgl1-mesa-dri
  python3-numpy python3-openimageio python3-requests python3-zstandard python3-jsonschema python3-cattr)

stop() {
  echo "error: $*" >&2
  exit 2
}

mirror() { # the first one in apt's own lists, in either of their two formats
  local lists=(/etc/apt/sources.list /etc/apt/sources.list.d/*) # the first is missing on newer systems
  { sed -nE 's/^URIs:[[:space:]]*([^[:space:]]+).*/\1/p; s/^deb[[:space:]]+(\[[^]]*\][[:space:]]+)?([^[:space:]]+).*/\2/p' \
    "${lists[@]}" 2>/dev/null || true; } | head -n 1
}

within() { # a command inside the folder; what is mounted for it goes away with it
  [[ $(id -u) == 0 ]] || stop "Blender in $root needs root; set BLENDER to an installed one instead"
  mkdir -p "$root$PWD"
  unshare --mount --propagation private bash -c '
    set -e
    mount --rbind /dev "$1/dev"
    mount -t proc proc "$1/proc"
    mount --bind "$2" "$1$2"
    root=$1 folder=$2
    shift 2
    exec chroot "$root" env --chdir="$folder" HOME=/root TMPDIR=/tmp LC_ALL=C.UTF-8 "$@"' within "$root" "$PWD" "$@"
}

make_root() {
  [[ $(id -u) == 0 ]] && command -v apt-get >/dev/null ||
    stop "no Blender here; install Blender 4.5 or newer and set BLENDER to its executable"
  command -v debootstrap >/dev/null || { apt-get -qq update && apt-get -qq install -y debootstrap; } >&2
  local from
  from=$(mirror)
  [[ -n $from ]] || stop "apt's lists name no mirror; set BLENDER to an installed Blender"
  echo "making Blender in $root (once)" >&2
  rm -rf "$root.part"
  debootstrap --variant=minbase sid "$root.part" "$from" >&2
  (
    root=$root.part
    within env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${packages[@]}" >&2
  )
  mv "$root.part" "$root"
}

inside() { # a command beside Blender, wherever that is
  if [[ -n ${BLENDER:-} ]]; then "$@"; else
    [[ -d $root ]] || make_root
    within "$@"
  fi
}

blender=${BLENDER:-blender}
verb=${1:-}
[[ -n $verb ]] && shift
case $verb in
blender) inside "$blender" "$@" ;;
run) inside "$@" ;;
window)
  if [[ -n ${DISPLAY:-} && -n ${BLENDER:-} ]]; then
    "$blender" "$@"
  else
    inside bash -c '
      # Xvfb takes a free screen number and says which.
      export XDG_RUNTIME_DIR=$(mktemp -d)
      numbers=$XDG_RUNTIME_DIR/number
      mkfifo "$numbers"
      Xvfb -displayfd 3 -screen 0 1600x1000x24 +extension GLX 3>"$numbers" >/dev/null 2>&1 &
      screen=$!
      read -r number <"$numbers"
      status=0
      DISPLAY=:$number "$@" || status=$?
      kill "$screen"
      exit "$status"' window "$blender" --window-geometry 0 0 1600 1000 "$@"
  fi
  ;;
remove) rm -rf "$root" ;;
*) sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
