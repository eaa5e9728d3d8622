#include "core/formats/vtk/messages.h"

#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkSmartPointer.h>

#include <algorithm>
#include <mutex>
#include <string_view>

namespace cadmorph {
namespace {

thread_local std::vector<std::string>* collected_errors = nullptr;

/// Collects the errors of VTK in a thread that asks for them; passes all else on.
class CollectingWindow : public vtkOutputWindow {
 public:
  static CollectingWindow* New();

  void DisplayErrorText(const char* text) override {
    if (!collected_errors)
      previous->DisplayErrorText(text);
    else if (!is_harmless(text))
      collected_errors->emplace_back(text);
  }
  void DisplayWarningText(const char* text) override {
    if (!collected_errors) previous->DisplayWarningText(text);
  }
  void DisplayGenericWarningText(const char* text) override {
    if (!collected_errors) previous->DisplayGenericWarningText(text);
  }
  void DisplayText(const char* text) override {
    if (!collected_errors) previous->DisplayText(text);
  }

  vtkSmartPointer<vtkOutputWindow> previous;

 private:
  /// The range of values that VTK's writer notes down with an array, and its reader refuses where
  /// it is infinite, though the array is sound; and an empty mesh, which check_mesh finds.
  static bool is_harmless(std::string_view text) {
    return text.find("Error reading InformationKey") != text.npos ||
           text.find("No Points element") != text.npos;
  }
};
vtkStandardNewMacro(CollectingWindow);

}  // namespace

SilentVtk::SilentVtk() {
  static std::once_flag installed;
  std::call_once(installed, [] {
    vtkNew<CollectingWindow> window;
    window->previous = vtkOutputWindow::GetInstance();
    vtkOutputWindow::SetInstance(window);
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
  });
  collected_errors = &errors_;
}

SilentVtk::~SilentVtk() { collected_errors = nullptr; }

std::string SilentVtk::first_error() const {
  if (errors_.empty()) return "unknown error";
  std::string text = errors_.front();
  if (const auto end = text.find("): "); end != std::string::npos) text.erase(0, end + 3);
  std::ranges::replace(text, '\n', ' ');
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

}  // namespace cadmorph
