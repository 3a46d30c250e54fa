#!/usr/bin/env bash
# Makes the image of deploy/Dockerfile without any registry: an empty root, the two programs as they were built here, and
# the shared libraries that they need.
#
#   deploy/image.sh [-t TAG] [FOLDER]
#
# TAG is `igi` if nothing is said, FOLDER where the programs are (target/release; built first if they are not there).
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)

tag=igi
while getopts t:h option; do
    case $option in
        t) tag=$OPTARG ;;
        h) sed -n '2,8s/^# \{0,1\}//p' "$0"; exit 0 ;;
        *) exit 2 ;;
    esac
done
shift $((OPTIND - 1))
folder=${1:-$here/target/release}

programs=(igi-master igi-worker)
if [[ $# -eq 0 ]]; then
    cargo build --manifest-path "$here/Cargo.toml" --release --locked --bin igi-master --bin igi-worker
fi
for program in "${programs[@]}"; do
    [[ -x $folder/$program ]] || { echo "$0: there is no $folder/$program: build it, or name another folder" >&2; exit 1; }
done

root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
chmod 755 "$root"
install -d -m 755 "$root"/usr/local/bin "$root"/etc
install -d -m 1777 "$root"/tmp
for program in "${programs[@]}"; do
    install -m 755 "$folder/$program" "$root/usr/local/bin/"
    strip "$root/usr/local/bin/$program" 2>/dev/null || true
    # The loader and every library, at the place where the loader looks for it.
    ldd "$folder/$program" | grep -o '/[^ ]*' | while read -r library; do
        install -D -m 755 "$library" "$root$library"
    done
done
echo 'nonroot:x:65532:65532:nonroot:/:/sbin/nologin' >"$root/etc/passwd"
echo 'nonroot:x:65532:' >"$root/etc/group"
# Names are looked up in /etc/hosts, then by DNS; glibc has both built in.
echo 'hosts: files dns' >"$root/etc/nsswitch.conf"

tar -C "$root" --owner=0 --group=0 --numeric-owner -c . | docker import \
    --change 'USER 65532:65532' \
    --change 'ENV PATH=/usr/local/bin' \
    --change 'EXPOSE 7464/udp 8080/tcp 9464/tcp' \
    --change 'CMD ["igi-worker"]' \
    - "$tag"
