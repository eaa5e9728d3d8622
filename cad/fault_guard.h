#pragma once

#include <array>
#include <csignal>

namespace cadmorph {

/// While alive, a fault in OCCT (it follows unresolved references of damaged data into the void)
/// becomes a Standard_Failure where OCC_CATCH_SIGNALS stands. The handlers before are put back,
/// those of interrupts at once. For one thread at a time: handlers are the process's.
class FaultGuard {
 public:
  FaultGuard();
  ~FaultGuard();
  FaultGuard(const FaultGuard&) = delete;
  FaultGuard& operator=(const FaultGuard&) = delete;

 private:
  static constexpr std::size_t kFaults = 4;  // the first of kSignals
  static constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGFPE, SIGILL,  SIGSYS,
                                       SIGTRAP, SIGHUP, SIGINT, SIGQUIT, SIGTERM};

  void restore(std::size_t from);

  std::array<struct sigaction, kSignals.size()> before_;
};

}  // namespace cadmorph
