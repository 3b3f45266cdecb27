// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "locfuse/filters/workers.hpp"

namespace locfuse::test_workers {
namespace {

/// Whether all of a loop is done, once.
bool shares(Workers& workers) {
  std::vector<int> done(1000, 0);
  workers.share(1000, 8, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      ++done[static_cast<std::size_t>(i)];
    }
  });
  return std::all_of(done.begin(), done.end(), [](int times) { return times == 1; });
}

TEST(Workers, a_forked_child_works_by_itself_and_ends) {  // it waited for helpers it did not have
  auto workers = std::make_unique<Workers>(3);
  EXPECT_TRUE(shares(*workers));
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(20);  // ends it where it waits for ever
    bool well = shares(*workers);
    Workers own(3);  // its threads may be where those of the parent were
    well = shares(own) && well;
    workers.reset();
    ::_exit(shares(own) && well ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_TRUE(shares(*workers));
}

}  // namespace
}  // namespace locfuse::test_workers
