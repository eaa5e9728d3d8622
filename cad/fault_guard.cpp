#include "cad/fault_guard.h"

#include <OSD.hxx>

namespace cadmorph {

FaultGuard::FaultGuard() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], nullptr, &before_[i]);
  OSD::SetSignal(OSD_SignalMode_Set, false);
  restore(kFaults);
}

FaultGuard::~FaultGuard() { restore(0); }

void FaultGuard::restore(std::size_t from) {
  for (std::size_t i = from; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

}  // namespace cadmorph
