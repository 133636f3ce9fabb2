#!/usr/bin/env bash
# A real Blender program out of a Debian suite, in a folder of its own that nothing else
# on the machine sees.
#   fetch_blender.sh SUITE FOLDER     trixie: Blender 4.3    sid: Blender 5.2 LTS
# Needs root and debootstrap. The programs run Python of their suite, with its PyTorch.
set -euo pipefail
suite=$1 root=$2
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
[ ! -e "$root/.complete" ] || exit 0
mkdir -p "$root"
root=$(realpath "$root")
if [ ! -e "$root/.bootstrapped" ]; then
    debootstrap --variant=minbase --include=ca-certificates "$suite" "$root" "$mirror"
    touch "$root/.bootstrapped"
fi

# The host's own certificates and name servers, for a mirror behind a company's gate.
cp /etc/resolv.conf "$root/etc/"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
cat > "$root/etc/apt/apt.conf.d/90small" <<'CONFIG'
APT::Install-Recommends "false";
APT::Sandbox::User "root";
Acquire::Check-Valid-Until "false";
Acquire::Languages "none";
CONFIG
printf '#!/bin/sh\nexit 101\n' > "$root/usr/sbin/policy-rc.d"
chmod 755 "$root/usr/sbin/policy-rc.d"

inside() {
    unshare --mount sh -c '
        root=$1; shift
        mount --bind /proc "$root/proc"; mount --rbind /dev "$root/dev"
        exec chroot "$root" env DEBIAN_FRONTEND=noninteractive LC_ALL=C \
            PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"' - "$root" "$@"
}
inside apt-get update -qq
inside apt-get install -y -qq blender python3-torch python3-numpy python3-requests \
    python3-zstandard xvfb openbox xdotool x11-utils imagemagick \
    libgl1 libegl1 libgl1-mesa-dri libglx-mesa0 python3-gi gir1.2-gtk-3.0
# Blender 5.2's extension module imports it without depending on it.
inside apt-get install -y -qq python3-cattr || true
inside apt-get clean

# Debian has no packages of these; the wheels are those of the program's Python.
python=$(inside python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')
"${PYTHON:-python3}" -m pip install --quiet --no-deps --only-binary :all: \
    --python-version "$python" --platform manylinux_2_28_x86_64 \
    --platform manylinux_2_27_x86_64 --platform manylinux2014_x86_64 \
    --target "$root/usr/local/lib/python$python/dist-packages" \
    safetensors OpenEXR mitsuba-oidn drjit nanobind-backend
inside blender --version | head -1
touch "$root/.complete"
