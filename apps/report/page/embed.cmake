# Writes OUT, a C++ source that holds the files of the report page.
# cmake -DOUT=... -DFOLDER=<apps/report> -DSCRIPT=... -DLICENCES=... -P embed.cmake
cmake_minimum_required(VERSION 3.25)

set(source "#include \"apps/report/report_assets.h\"\n\nnamespace cadmorph {\n")
function(embed name file)
  file(READ ${file} text)
  string(APPEND source
    "\nconst std::string_view ${name} = R\"embedded(${text})embedded\";\n")
  set(source "${source}" PARENT_SCOPE)
endfunction()

embed(kPageTemplate ${FOLDER}/page.mustache)
embed(kBinTableTemplate ${FOLDER}/bin_table.mustache)
embed(kPageStyle ${FOLDER}/page.css)
embed(kPageScript ${SCRIPT})
embed(kPageLicences ${LICENCES})
file(WRITE ${OUT} "${source}\n}  // namespace cadmorph\n")
