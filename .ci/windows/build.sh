#!/usr/bin/env bash
# A Python for Windows that runs under Wine, with this project in it: .ci/windows/build.sh FOLDER
#
# FOLDER/python then runs in any folder what `python` would on Windows. It needs Debian's wine, wine64
# and gcc-mingw-w64-x86-64, and a Python 3.11 with venv; all else comes as wheels. No index of packages
# has an installer of Python for Windows, but Panda3D's wheel has the part of it that is compiled, for the
# programs that are made with it; the other part is the same on all systems. Stand-ins on Linux alone would show only what
# was expected; Wine does not show timing, consoles, sound, graphics or access lists.
set -euo pipefail
here=$(realpath "$(dirname "$0")")
project=$(realpath "$here/../..")
folder=$(realpath -m "$1")
for tool in wine x86_64-w64-mingw32-gcc python3.11; do
    if ! command -v "$tool" >/dev/null; then
        echo "$tool is missing: apt-get install wine wine64 gcc-mingw-w64-x86-64 python3.11-venv" >&2
        exit 1
    fi
done
mkdir -p "$folder/py/DLLs"
cd "$folder"
export WINEPREFIX=$folder/prefix WINEDEBUG=-all WINEDLLOVERRIDES="mscoree,mshtml=" DISPLAY=

compiled() { x86_64-w64-mingw32-gcc -O2 -s -Wall -Werror -static-libgcc "$@"; }

exported() { # the names of what a library exports
    x86_64-w64-mingw32-objdump -p "$1" | awk '/^\[Ordinal\/Name Pointer\]/ {on = 1; next} !/^\t\[/ {on = 0}
        on {print $NF}'
}

# Wheels for Windows: uv reads the markers of a requirement for the system that it is meant for.
python3.11 -m venv tools
tools/bin/pip install -q uv
packages=$folder/py/Lib/site-packages
mkdir -p "$packages"
standard=$(python3.11 -c 'import sysconfig; print(sysconfig.get_path("stdlib"))')
tar -C "$standard" -c --exclude=lib2to3 --exclude=site-packages --exclude=dist-packages --exclude=__pycache__ \
    --exclude='./config-3*' --exclude=lib-dynload --exclude=./test . | tar -C py/Lib -x
# The compiled part calls it of the class, as this library does from 3.11.8 on.
metadata=py/Lib/importlib/metadata/__init__.py
grep -B1 'def invalidate_caches' $metadata | grep -q classmethod ||
    sed -i 's/^    def invalidate_caches/    @classmethod\n&/' $metadata
wheels=(tools/bin/uv pip install -q --target "$packages"
    --python-platform x86_64-pc-windows-msvc --python-version 3.11)
"${wheels[@]}" --only-binary :all: --extra test -r "$project/pyproject.toml"
"${wheels[@]}" --no-deps -e "$project"
sed -i 's,^/,Z:/,' "$packages/_labcrane.pth" # where Wine shows this computer's files
python3.11 -m compileall -q -j0 py/Lib >/dev/null || true # under Wine it takes minutes

# Python: the stable interface, python3.dll, is python311.dll under another name.
cp "$packages"/deploy_libs/*.pyd py/DLLs/
cp "$packages"/deploy_libs/{libcrypto-3,libssl-3,libffi-8,sqlite3,tcl86t,tk86t}.dll py/DLLs/
cp "$packages"/deploy_libs/{python311,VCRUNTIME140}.dll py/
compiled -municode -o py/python.exe "$here/python.c"
{
    echo EXPORTS
    exported py/python311.dll | sed 's/.*/  &=python311.&/'
} >python3.def
compiled -shared -nostdlib -Wl,--entry=0 -o py/python3.dll python3.def

# Wine: its ucrtbase becomes ucrtwine, behind a ucrtbase that has what it leaves out.
wine wineboot -i >/dev/null 2>&1
wineserver -w
system=prefix/drive_c/windows/system32
compiled -shared -o $system/bcryptprimitives.dll "$here/bcryptprimitives.c" -ladvapi32
cp $system/ucrtbase.dll $system/ucrtwine.dll
# Without its mark as Wine's own: those are looked for by name in Wine's folder.
printf '%32s' '' | tr ' ' '\0' |
    dd of=$system/ucrtwine.dll bs=1 seek=64 conv=notrunc status=none
compiled -c -o ucrt.o "$here/ucrt.c"
own=" $(x86_64-w64-mingw32-nm ucrt.o | sed -n 's/.* T own_//p' | tr '\n' ' ')"
{
    echo EXPORTS
    for name in $(exported $system/ucrtwine.dll); do
        case $own in
        *" $name "*) echo "  $name=own_$name" ;;
        *) echo "  $name=ucrtwine.$name" ;;
        esac
    done
} >ucrtbase.def
compiled -shared -o ucrtbase.dll ucrt.o ucrtbase.def
mv ucrtbase.dll $system/
wine winecfg -v win10
wine reg add 'HKCU\Software\Wine\DllOverrides' /v ucrtbase /d native /f >/dev/null
wineserver -w

cat >python <<'RUN'
#!/usr/bin/env bash
folder=$(dirname "$(realpath "$0")")
export WINEPREFIX=$folder/prefix WINEDEBUG=${WINEDEBUG:--all}
export WINEDLLOVERRIDES="winedbg.exe=d" # it describes a crash for half a minute
wine "$folder/py/python.exe" "$@" 2>&1 | cat # Wine knows nothing of a file that is only written
exit "${PIPESTATUS[0]}"
RUN
chmod +x python
./python -c 'import sys, numpy, h5py; print(sys.version, sys.platform, numpy.sqrt(-1 + 0j))'
