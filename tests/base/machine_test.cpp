#include "base/machine.h"

#include <gtest/gtest.h>

#include <vector>

namespace traceflow {
namespace {

TEST(Machine, ReadsWhatTheSystemTells) {
  EXPECT_EQ(processor_name("processor\t: 0\nmodel\t\t: 85\nmodel name\t: A Chip @ 2.70GHz\n\nprocessor : 1\n"
                           "model name : Another\n"),
            "A Chip @ 2.70GHz");
  EXPECT_EQ(processor_name("Model : A Board Rev 1.1"), "A Board Rev 1.1");
  EXPECT_EQ(total_memory("MemFree: 5 kB\nMemTotal:       16384 kB\n"), 16 << 20);
  EXPECT_EQ(resident_memory("1000 25 3 1 0 4 0\n", 4096), 25 * 4096);
}

TEST(Machine, TextThatTellsNothingIsNoError) {
  for (const char* text : {"", "\n", ":", "model name", "model name:", "MemTotal: many kB", "MemTotal: -5",
                           "7", "7 ", "7 x", "\n\n:\n"}) {
    EXPECT_EQ(processor_name(text), "") << text;
    EXPECT_EQ(total_memory(text), 0) << text;
    EXPECT_EQ(resident_memory(text, 4096), 0) << text;
  }
}

TEST(Machine, ThisOneHasAProcessorAndMemory) {
  const Machine machine = this_machine(Device::cpu);
  EXPECT_FALSE(machine.processor.empty());
  EXPECT_FALSE(machine.system.empty());
  EXPECT_GE(machine.threads, 1);
  EXPECT_GT(machine.memory_bytes, 0);
  EXPECT_TRUE(machine.gpu.empty());
}

TEST(Machine, MemoryInUseGrowsByWhatIsTaken) {
  const int64_t before = memory_in_use(Device::cpu);
  const std::vector<char> taken(64 << 20, 1);
  const int64_t after = memory_in_use(Device::cpu);
  EXPECT_GT(before, 0);
  EXPECT_GE(after - before, 48 << 20) << taken.size();
}

}  // namespace
}  // namespace traceflow
