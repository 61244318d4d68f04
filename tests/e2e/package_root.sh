#!/bin/sh
# Installs the Debian package that ./dev package built in a bare root of Debian 12, runs the closed
# loop there with images, reads manual and completion, removes the package, and looks for what it
# left.
#
# What it needs, and the environment: tests/debian_root.sh.
set -eu

sources=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd -P)
. "$sources/tests/debian_root.sh"

package=$(ls -t "$sources"/dist/boresight_*.deb 2>/dev/null | head -n 1)
[ -n "$package" ] || skip "no package in dist: run ./dev package"

make_root bookworm ca-certificates
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp "$package" "$root/package.deb"
enter sh -euc '
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update
    dpkg-deb -c package.deb | sed "s,.* \./,/," | grep -v "/$" | sort >/listed
    apt-get -qq install -y --no-install-recommends /package.deb >/log 2>&1 || { tail /log; exit 1; }
    cd /tmp
    boresight --version
    boresight run /usr/share/boresight/scenarios/neossat_geo_track.json --out run --duration 30 --quiet
    test -s run/frames.fits
    bash -c ". /usr/share/bash-completion/completions/boresight; complete -p boresight"
    apt-get -qq purge -y boresight >/log 2>&1 || { tail /log; exit 1; }
    left=$(while read -r file; do [ ! -e "$file" ] || echo "$file"; done </listed)
    [ -z "$left" ] || { echo "left behind: $left"; exit 1; }
    [ ! -e /usr/share/boresight ] || { echo "left behind: /usr/share/boresight"; exit 1; }
'
echo "installed, run and removed: $(basename -- "$package")"
