// Start-up and board code of the bare-metal image: vector table, reset, stack paint, semihosting, SysTick.
#include "board.hpp"

#include <bit>

extern "C" {
// Set by the linker script; only their addresses mean something.
extern std::uint32_t heft_data_begin, heft_data_end, heft_data_source;
extern std::uint32_t heft_bss_begin, heft_bss_end;
extern std::uint32_t heft_stack_bottom, heft_stack_top;
extern char heft_flash_used, heft_log_begin, heft_log_end;
using Initializer = void (*)();
extern Initializer heft_init_begin[], heft_init_end[];

[[noreturn]] void heft_reset();
[[noreturn]] void heft_fault();
}

namespace {

using heft::firmware::leave;
using heft::firmware::print;

constexpr std::uint32_t kPaint = 0xC5C5C5C5U;

struct VectorTable {
  std::uint32_t* stack_top;
  void (*handlers[15])();
};

// Reset, then NMI .. SysTick: no interrupt is used, so that every other entry is a fault.
[[gnu::section(".vectors"), gnu::used]] const VectorTable kVectors = {
    &heft_stack_top,
    {heft_reset, heft_fault, heft_fault, heft_fault, heft_fault, heft_fault, heft_fault, heft_fault,
     heft_fault, heft_fault, heft_fault, heft_fault, heft_fault, heft_fault, heft_fault}};

volatile std::uint32_t& device_register(std::uintptr_t address) noexcept {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}

std::size_t bytes_between(const void* begin, const void* end) noexcept {
  return reinterpret_cast<std::uintptr_t>(end) - reinterpret_cast<std::uintptr_t>(begin);
}

// Arm semihosting, A32/T32 profile: operation in r0, argument in r1, answer in r0.
std::uint32_t semihosting(std::uint32_t operation, const void* argument) noexcept {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

// Runs with the FPU on; not inlined, so that no FPU instruction of it moves in front of the switch.
[[gnu::noinline, noreturn]] void run() {
  for (Initializer* p = heft_init_begin; p != heft_init_end; ++p) (*p)();
  leave(firmware_main());
}

// @param mantissa  the 52 bits behind the point
void print_hexadecimal(bool negative, int biased_exponent, int bias, std::uint64_t mantissa) noexcept {
  const bool normal = biased_exponent != 0;
  const int exponent = normal ? biased_exponent - bias : (mantissa == 0 ? 0 : 1 - bias);
  char text[20];
  char* p = text;
  if (negative) *p++ = '-';
  *p++ = '0';
  *p++ = 'x';
  *p++ = normal ? '1' : '0';
  *p++ = '.';
  for (int shift = 48; shift >= 0; shift -= 4) *p++ = "0123456789abcdef"[(mantissa >> shift) & 0xF];
  *p++ = 'p';
  *p = '\0';
  print(text);
  if (exponent < 0) print("-");
  print(static_cast<std::uint64_t>(exponent < 0 ? -exponent : exponent));
}

}  // namespace

void heft_reset() {
  // The stores go through volatile pointers: a call of memset would run on the stack being painted.
  std::uint32_t* stack_pointer;
  asm volatile("mov %0, sp" : "=r"(stack_pointer));
  for (volatile std::uint32_t* p = &heft_stack_bottom; p < stack_pointer; p = p + 1) *p = kPaint;
  const volatile std::uint32_t* source = &heft_data_source;
  for (volatile std::uint32_t* p = &heft_data_begin; p < &heft_data_end; p = p + 1) {
    *p = *source;
    source = source + 1;
  }
  for (volatile std::uint32_t* p = &heft_bss_begin; p < &heft_bss_end; p = p + 1) *p = 0;

  // CPACR: full access to coprocessors 10 and 11, the FPU.
  device_register(0xE000ED88) = device_register(0xE000ED88) | (0xFU << 20);
  asm volatile("dsb\n\tisb" ::: "memory");
  run();
}

void heft_fault() {
  print("fault: ICSR ");
  print(device_register(0xE000ED04) & 0x1FFU);
  print(" CFSR ");
  print(device_register(0xE000ED28));
  print("\n");
  leave(70);
}

namespace heft::firmware {

void print(const char* text) noexcept { semihosting(0x04, text); }  // SYS_WRITE0

void print(std::uint64_t number) noexcept {
  char digits[21];
  char* begin = digits + sizeof(digits) - 1;
  *begin = '\0';
  do {
    *--begin = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  print(begin);
}

void print_exact(double number) noexcept {
  const auto bits = std::bit_cast<std::uint64_t>(number);
  print_hexadecimal((bits >> 63) != 0, static_cast<int>((bits >> 52) & 0x7FF), 1023,
                    bits & ((std::uint64_t{1} << 52) - 1));
}

// Not by way of double: that would bring its arithmetic into an image in single precision.
void print_exact(float number) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(number);
  print_hexadecimal((bits >> 31) != 0, static_cast<int>((bits >> 23) & 0xFF), 127,
                    std::uint64_t{bits & ((1U << 23) - 1)} << 29);
}

void leave(int code) noexcept {
  const std::uint32_t block[2] = {0x20026, static_cast<std::uint32_t>(code)};  // ADP_Stopped_ApplicationExit
  semihosting(0x20, block);                                                    // SYS_EXIT_EXTENDED
  while (true) {
  }
}

void start_counter() noexcept {
  device_register(0xE000E014) = 0x00FFFFFF;  // reload
  device_register(0xE000E018) = 0;           // clears the current value
  device_register(0xE000E010) = 0x5;         // enable, processor clock, no interrupt
}

std::uint32_t counter() noexcept { return device_register(0xE000E018); }

std::size_t deepest_stack() noexcept {
  const volatile std::uint32_t* p = &heft_stack_bottom;
  while (p < &heft_stack_top && *p == kPaint) p = p + 1;
  return bytes_between(const_cast<const std::uint32_t*>(p), &heft_stack_top);
}

Footprint footprint() noexcept {
  return {.flash = reinterpret_cast<std::uintptr_t>(&heft_flash_used),
          .log = bytes_between(&heft_log_begin, &heft_log_end),
          .ram = bytes_between(&heft_data_begin, &heft_bss_end),
          .stack = bytes_between(&heft_stack_bottom, &heft_stack_top)};
}

}  // namespace heft::firmware
