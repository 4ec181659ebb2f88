/// @file
/// What the bare-metal image needs of its board: console and exit by semihosting, a counter, the stack.
#pragma once

#include <cstddef>
#include <cstdint>

namespace heft::firmware {

/// Prints a string on the console of the debugger or of QEMU.
void print(const char* text) noexcept;
/// Prints a whole number in decimal.
void print(std::uint64_t number) noexcept;
/// Prints a finite number as a C hexadecimal float, every bit of it.
void print_exact(double number) noexcept;
void print_exact(float number) noexcept;

/// Ends the run; the process exit code of QEMU is `code`.
[[noreturn]] void leave(int code) noexcept;

/// Starts the cycle counter (SysTick on the processor clock).
void start_counter() noexcept;
/// Counter value; counts down and wraps at 24 bit.
std::uint32_t counter() noexcept;
/// Ticks from one counter value to a later one, less than a wrap apart.
constexpr std::uint32_t ticks_between(std::uint32_t from, std::uint32_t to) noexcept {
  return (from - to) & 0x00FFFFFFU;
}
/// Instructions in a tick under QEMU's `-icount shift=0`: an instruction takes 1 ns of virtual time and
/// the board's clock is 25 MHz.
inline constexpr std::uint32_t kInstructionsPerTick = 40;

/// Bytes of stack ever used since reset, found by looking for the paint.
std::size_t deepest_stack() noexcept;

/// Memory of the image [byte], from the linker's symbols.
struct Footprint {
  std::size_t flash;  ///< code, constants and initial values of variables, without the replayed log
  std::size_t log;    ///< the replayed log
  std::size_t ram;    ///< variables, without the stack
  std::size_t stack;  ///< reserved for the stack
};
Footprint footprint() noexcept;

}  // namespace heft::firmware

/// The program, called by the reset handler. Returns the exit code.
int firmware_main();
