#pragma once

#include <memory>

namespace cadmorph {

/// While alive, OCCT heals what it reads with the same result, at a cost that grows with the part.
/// It asks for each wire what became of the whole face: a plate with 2,000 holes takes it 10 s.
/// Here the answer is kept until something is replaced. For one thread at a time: the tools of
/// healing are the process's.
class QuickHealing {
 public:
  QuickHealing();
  ~QuickHealing();
  QuickHealing(const QuickHealing&) = delete;
  QuickHealing& operator=(const QuickHealing&) = delete;

 private:
  struct Before;
  std::unique_ptr<Before> before_;
};

}  // namespace cadmorph
