#pragma once

#include <array>
#include <csignal>
#include <string>

class Standard_Failure;

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

/// OCCT's failure as an error of ours: std::bad_alloc where it had no memory, else a CadError of
/// what fails, OCCT's words and what to do. OCCT's own are no std::exception.
[[noreturn]] void throw_as_error(const Standard_Failure& failure, const std::string& what,
                                 const std::string& remedy);

}  // namespace cadmorph
