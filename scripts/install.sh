# shellcheck shell=sh disable=SC2154
# SPDX-License-Identifier: Apache-2.0
# Part of ./dev: whether bare systems can install it, each in a folder of its own below build/install, made by
# debootstrap. Needs root. What this machine says of apt, pip and certificates holds there, too.

bare=$PWD/build/install

# A bare Debian: build/install/NAME.
make_root() { # name, suite
  [ "$(id -u)" -eq 0 ] || fail "test-install needs root: it makes systems in folders and enters them"
  need_debian debootstrap git
  if [ ! -e "$bare/$2.bare/done" ]; then
    rm -rf "$bare/$2.bare"
    mkdir -p "$bare"
    echo "making a bare $2"
    quietly "debootstrap could not make a bare $2: is there a network?" \
      debootstrap --variant=minbase --include=ca-certificates "$2" "$bare/$2.bare"
    touch "$bare/$2.bare/done"
  fi
  ! grep -q " $bare/$1/" /proc/mounts || fail "something of this machine is mounted below $bare/$1: umount it"
  rm -rf "${bare:?}/$1"
  cp -a "$bare/$2.bare" "$bare/$1"
  cp -r /etc/apt/apt.conf.d/. "$bare/$1/etc/apt/apt.conf.d/"
  cp /etc/resolv.conf /etc/hosts "$bare/$1/etc/"
  [ ! -e /etc/pip.conf ] || cp /etc/pip.conf "$bare/$1/etc/"
  user_pip=${XDG_CONFIG_HOME:-$HOME/.config}/pip/pip.conf
  [ ! -e "$user_pip" ] || cp "$user_pip" "$bare/$1/etc/pip-user.conf"
  cp -L /etc/ssl/certs/ca-certificates.crt "$bare/$1/etc/ssl/certs/"
}

# Runs a command in a system, which ends with all that it mounted. In /opt some machines have packages for pip.
in_root() { # name, command for its shell
  # shellcheck disable=SC2016
  unshare --mount --pid --fork --kill-child sh -ec '
    root=$1
    command=$2
    set --
    for name in $(env | sed -n "s/^\(PIP_[A-Z_]*\|[a-z]*_proxy\|[A-Z]*_PROXY\)=.*/\1/p"); do
      eval "set -- \"\$@\" \"$name=\$$name\""
    done
    mount -t proc proc "$root/proc"
    mount --bind /opt "$root/opt"
    mount -o remount,bind,ro "$root/opt"
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@" PIP_CONFIG_FILE=/etc/pip-user.conf \
      chroot "$root" /bin/sh -c "$command"' in_root "$bare/$1" "$2"
}

timed() { # words, command
  began=$(date +%s)
  words=$1
  shift
  "$@" || fail "$words failed"
  echo "$words: $(($(date +%s) - began)) s"
}

# `./dev demo` and `./dev test` as the first commands on a bare system.
test_debian() { # suite
  make_root "$1" "$1"
  mkdir "$bare/$1/locfuse"
  git archive HEAD | tar -x -C "$bare/$1/locfuse"
  timed "$1: ./dev demo" in_root "$1" "cd /locfuse && ./dev demo"
  [ -s "$bare/$1/locfuse/out/demo/office/report.html" ] || fail "$1: ./dev demo wrote no report"
  timed "$1: ./dev test" in_root "$1" "cd /locfuse && ./dev test"
}

# The steps of the Dockerfile, each stage in a system of its own; then what the image is for.
test_image() {
  stage=
  environment=
  while read -r step words <&3; do
    case $step in
    FROM)
      stage=image-${words##* }
      case $stage in *:*) stage=image ;; esac
      make_root "$stage" bookworm
      folder=/
      environment=
      ;;
    WORKDIR)
      folder=$words
      mkdir -p "$bare/$stage$folder"
      ;;
    ENV) environment="$environment export $words;" ;;
    COPY)
      case $words in
      "--from="*)
        from=${words%% *}
        from=${from#--from=}
        path=${words##* }
        mkdir -p "$bare/$stage${path%/*}"
        cp -a "$bare/image-$from$path" "$bare/$stage$path"
        ;;
      ". .") git archive HEAD | tar -x -C "$bare/$stage$folder" ;;
      *) fail "Dockerfile: test-install does not know COPY $words" ;;
      esac
      ;;
    RUN)
      echo "$stage: $words" | cut -c1-100
      quietly "Dockerfile: $words" in_root "$stage" "cd $folder && $words" </dev/null
      ;;
    EXPOSE | CMD | '#'* | '') ;;
    *) fail "Dockerfile: test-install does not know $step" ;;
    esac
  done 3<Dockerfile
  timed "image: locfuse demo" in_root "$stage" "$environment cd $folder && locfuse demo"
  quietly "image: the studio does not start" in_root "$stage" \
    "$environment cd $folder && { timeout 20 locfuse studio --host 127.0.0.1 >studio.txt 2>&1; grep -q token= studio.txt; }"
}

test_install() { # bookworm, trixie, image: all by default
  [ $# -gt 0 ] || set -- bookworm trixie image
  for system in "$@"; do
    case $system in
    bookworm | trixie) test_debian "$system" ;;
    image) test_image ;;
    *) fail "expected bookworm, trixie or image, got $system" ;;
    esac
  done
}
