# Writes OUT, a C++ source that holds the files of the report page; SCRIPT and LICENCES may be missing.
# cmake -DOUT=... -DFOLDER=<apps/report/page> -DSCRIPT=... -DLICENCES=... -P embed.cmake
cmake_minimum_required(VERSION 3.25)

set(source "#include \"apps/report/report_assets.h\"\n\nnamespace cadmorph {\n")
function(embed name file)
  set(text "")
  if(EXISTS ${file})
    file(READ ${file} text)
  endif()
  string(APPEND source
    "\nconst std::string_view ${name} = R\"embedded(${text})embedded\";\n")
  set(source "${source}" PARENT_SCOPE)
endfunction()

embed(kPageTemplate ${FOLDER}/page.mustache)
embed(kBinTableTemplate ${FOLDER}/bin_table.mustache)
embed(kOverviewTemplate ${FOLDER}/overview.mustache)
embed(kPageStyle ${FOLDER}/page.css)
embed(kPageScript ${SCRIPT})
embed(kPageLicences ${LICENCES})
string(APPEND source "\n}  // namespace cadmorph\n")
set(old "")
if(EXISTS ${OUT})
  file(READ ${OUT} old)
endif()
if(NOT source STREQUAL old)
  file(WRITE ${OUT} "${source}")
endif()
