// The image's program: replays the log, prints the results and what they cost, one `key value` a line.
#include "../log_table.hpp"
#ifdef HEFT_ONLINE
#include "../online_replay.hpp"
#else
#include "../replay.hpp"
#endif
#include "board.hpp"

// The table goes in as it is, aligned for its floats.
asm(".section .log,\"a\",%progbits\n"
    ".balign 4\n"
    "heft_log_table: .incbin \"" HEFT_LOG_TABLE
    "\"\n"
    ".previous\n");
extern "C" const char heft_log_table[];

namespace {

using namespace heft::firmware;

// Static, so that the linker's figures for RAM hold it and the stack does not.
#ifdef HEFT_ONLINE
using Loop = OnlineReplay<HEFT_SCALAR>;
#else
using Loop = Replay<HEFT_SCALAR>;
#endif
Loop replay;

template <typename Value>
void print_line(const char* key, Value value) {
  print(key);
  print(" ");
  print(value);
  print("\n");
}

// A loop of known length must take the ticks it should; without `-icount shift=0` it does not.
bool counter_counts_instructions() {
  constexpr std::uint32_t kLoops = 400'000;
  std::uint32_t loops = kLoops;
  const std::uint32_t begin = counter();
  asm volatile("1: subs %0, %0, #1\n\tbne 1b" : "+r"(loops)::"cc");
  const std::uint32_t ticks = ticks_between(begin, counter());
  constexpr std::uint32_t kDue = 2 * kLoops / kInstructionsPerTick;
  return ticks >= kDue && ticks <= kDue + 1;
}

}  // namespace

int firmware_main() {
  const LogRow* const rows = rows_of(heft_log_table);
  if (rows == nullptr) {
    print("the replayed log is not a log table\n");
    return 1;
  }
  const auto& header = *reinterpret_cast<const LogHeader*>(heft_log_table);

  if (replay.configure() != heft::Status::kOk) {
    print("the replay refuses its settings\n");
    return 1;
  }

  const auto period = static_cast<HEFT_SCALAR>(1e-6F * static_cast<float>(header.period_us));
  start_counter();
  const bool counts = counter_counts_instructions();
  std::uint64_t total = 0;
  std::uint32_t worst = 0, worst_sample = 0;
  for (std::uint32_t i = 0; i < header.samples; ++i) {
    const std::uint32_t begin = counter();
    const heft::Status status = replay.step(rows[i], period);
    const std::uint32_t ticks = ticks_between(begin, counter());
    if (status != heft::Status::kOk) {
      print_line("refused_sample", std::uint64_t{i});
      print_line("status", heft::to_string(status));
      return 1;
    }
    total += ticks;
    if (ticks > worst) {
      worst = ticks;
      worst_sample = i;
    }
  }
  const std::size_t stack = deepest_stack();

  print_line("image", HEFT_IMAGE);
  print_line("samples", std::uint64_t{header.samples});
  print_line("period_us", std::uint64_t{header.period_us});
  const Footprint memory = footprint();
  print_line("flash_bytes", std::uint64_t{memory.flash});
  print_line("log_bytes", std::uint64_t{memory.log});
  print_line("ram_bytes", std::uint64_t{memory.ram});
  print_line("stack_reserved_bytes", std::uint64_t{memory.stack});
  print_line("deepest_stack_bytes", std::uint64_t{stack});
  if (counts) {
    print_line("instructions_mean", total * kInstructionsPerTick / header.samples);
    print_line("instructions_worst", std::uint64_t{worst} * kInstructionsPerTick);
    print_line("worst_sample", std::uint64_t{worst_sample});
  }
  print_line("source", replay.rests_on());
  print_line("loop_bytes", std::uint64_t{sizeof(replay)});
  for (int i = 0; i < Loop::kNumResults; ++i) {
    print("result ");
    print_exact(replay.result(i));
    print("\n");
  }
  print("done\n");
  return 0;
}
