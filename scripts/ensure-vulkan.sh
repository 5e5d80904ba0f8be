#!/usr/bin/env bash
# Makes sure that there is a Vulkan loader and at least one driver; `make run` and `make test` call it.
#
# A driver is a GPU's own or Mesa's lavapipe, which renders on the CPU. Where neither is there, Debian's
# mesa-vulkan-drivers (which holds lavapipe) is installed by apt-get, and the script says so. Which adapter is
# used is the server's word: it logs the name and whether it is a software one.
set -euo pipefail

packages=(libvulkan1 mesa-vulkan-drivers)

say() { printf 'ensure-vulkan: %s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

# Metal and DirectX need no Vulkan.
case "$OSTYPE" in linux*) ;; *) exit 0 ;; esac

has_loader() {
    local loader
    for loader in /usr/lib/*/libvulkan.so.1 /usr/lib/libvulkan.so.1 /usr/lib64/libvulkan.so.1 \
        /usr/local/lib/libvulkan.so.1 /lib/*/libvulkan.so.1; do
        [ -e "$loader" ] && return 0
    done
    # Elsewhere, by LD_LIBRARY_PATH.
    local folder folders
    IFS=: read -r -a folders <<<"${LD_LIBRARY_PATH:-}"
    for folder in "${folders[@]}"; do
        [ -n "$folder" ] && [ -e "$folder/libvulkan.so.1" ] && return 0
    done
    return 1
}

# Where they are set, the loader reads these and no folder: installing packages would change nothing.
named_drivers="${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}"

has_driver() {
    local file files
    if [ -n "$named_drivers" ]; then
        IFS=: read -r -a files <<<"$named_drivers"
    else
        files=(/usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json
            "${XDG_DATA_HOME:-${HOME:-}/.local/share}"/vulkan/icd.d/*.json)
    fi
    for file in "${files[@]}"; do
        [ -e "$file" ] && return 0
    done
    return 1
}

if [ -n "$named_drivers" ] && ! has_driver; then
    fail "VK_DRIVER_FILES or VK_ICD_FILENAMES names no file that exists ($named_drivers); correct or unset it"
fi
if has_loader && has_driver; then
    exit 0
fi

command -v apt-get >/dev/null ||
    fail "no Vulkan loader or driver, and no apt-get to install one: install your system's Vulkan loader and a" \
        "driver (Mesa's lavapipe will do), named ${packages[*]} on Debian"

as_root=()
if [ "$EUID" -ne 0 ]; then
    command -v sudo >/dev/null ||
        fail "no Vulkan loader or driver, and neither root nor sudo to install one: as root, run" \
            "apt-get install ${packages[*]}"
    as_root=(sudo)
fi

say "no Vulkan loader or driver found: installing Debian's ${packages[*]}"
# A fresh machine has no package lists. A mirror that fails here may still hold what the lists already name.
"${as_root[@]}" apt-get update -qq || say "apt-get update failed; trying with the package lists that are there"
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${packages[@]}" >&2 ||
    fail "apt-get could not install ${packages[*]}"
if ! has_loader || ! has_driver; then
    fail "${packages[*]} are installed, but no Vulkan loader and driver can be found"
fi
say "installed ${packages[*]}"
