# Shared by the scripts in this folder; source it, do not run it.

# The checkout these scripts belong to, whatever folder they are called from.
heft_root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)

say() { printf 'heft: %s\n' "$*" >&2; }
fail() { printf 'heft: %s\n' "$*" >&2; exit 1; }

# One compile job a core, but no more than memory can feed (about 2.2 GB for the largest files).
heft_jobs() {
  local jobs memory
  jobs=$(nproc 2>/dev/null || echo 2)
  memory=$(awk '/^MemAvailable:/ {print int($2 / 2200000)}' /proc/meminfo 2>/dev/null || echo "$jobs")
  if [ "${memory:-0}" -ge 1 ] && [ "$memory" -lt "$jobs" ]; then jobs=$memory; fi
  echo "$jobs"
}

# heft_configure BUILD_FOLDER CMAKE_ARGUMENTS...   Keeps the generator of a build folder that exists. Up to 24
# files are compiled at once, a third less work and more: what they share is parsed and instantiated once; 2.2 GB at most.
heft_configure() {
  local build=$1
  shift
  local generator=()
  if [ ! -f "$build/CMakeCache.txt" ]; then generator=(-G Ninja); fi
  cmake -S "$heft_root" -B "$build" "${generator[@]}" --log-level=WARNING -DCMAKE_UNITY_BUILD=ON \
    -DCMAKE_UNITY_BUILD_BATCH_SIZE=24 "$@" >&2
}
