#include "cad/fault_guard.h"

#include <OSD.hxx>
#include <Standard_OutOfMemory.hxx>
#include <new>

#include "core/errors.h"

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

void throw_as_error(const Standard_Failure& failure, const std::string& what,
                    const std::string& remedy) {
  if (failure.IsKind(STANDARD_TYPE(Standard_OutOfMemory))) throw std::bad_alloc();
  throw CadError(what + " (OCCT: " + failure.GetMessageString() + "). " + remedy);
}

}  // namespace cadmorph
