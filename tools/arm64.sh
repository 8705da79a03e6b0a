#!/bin/sh
# Compile the kernels for arm64 and run tests that do not need ROS under emulation.
#
#   apt install g++-aarch64-linux-gnu mmdebstrap qemu-user-static
#   make arm64 ARGS='test/test_laws.py test/test_batch.py'
#
# Everything goes into .arm64: Debian's Python, the packages, and the build.
set -e
cd "$(dirname "$0")/.."
bin=$PWD/.venv/bin root=$PWD/.arm64/root site=$PWD/.arm64/site build=$PWD/.arm64/build
mkdir -p .arm64

[ -d "$root" ] || mmdebstrap --quiet --arch=arm64 --variant=extract \
    --include=libpython3.11-dev,libstdc++6,python3.11 bookworm "$root" http://deb.debian.org/debian
"$bin/pip" install --quiet --upgrade --target "$site" --only-binary=:all: --python-version 3.11 \
    --platform manylinux2014_aarch64 --platform manylinux_2_28_aarch64 \
    array-api-strict hypothesis mpmath numpy pytest python-flint pyyaml scipy

"$bin/cmake" -G Ninja -S collision_response/kernels -B "$build" -DCMAKE_MAKE_PROGRAM="$bin/ninja" \
    -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
    -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++ -DCMAKE_CXX_FLAGS="-idirafter $root/usr/include" \
    -DPython3_EXECUTABLE="$bin/python" -DPython3_INCLUDE_DIR="$root/usr/include/python3.11" \
    -DPython3_LIBRARY="$root/usr/lib/aarch64-linux-gnu/libpython3.11.so.1.0" > "$build.log"
"$bin/ninja" -C "$build" >> "$build.log"
rm -rf "$site/collision_response"
cp -r collision_response "$site"
for module in _compiled _derivatives; do
    cp "$build/$module"*.so "$site/collision_response/kernels/$module.so"
done

# -P: import the package in .arm64, not the source directory.
qemu-aarch64-static -L "$root" -E PYTHONPATH="$site" "$root/usr/bin/python3.11" -P -m pytest -q -p no:cacheprovider "$@"
