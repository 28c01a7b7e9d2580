# SPDX-License-Identifier: MIT
# Makes OUTPUT, the page of `skeletex view` without its data, from the sources in SOURCE: installs the packages that
# package-lock.json pins into WORK with NPM, and bundles with esbuild. Where that cannot be done, OUTPUT is empty and
# STAMP is missing, so that the next build tries again; the program then says what to install.
file(MAKE_DIRECTORY ${WORK})
file(REMOVE ${STAMP})

function(give_up reason)
  message(WARNING "The page of `skeletex view` is left out: ${reason}")
  file(WRITE ${OUTPUT} "")
endfunction()

if(NOT NPM)
  give_up("npm is missing; scripts/install-dependencies.sh installs it")
  return()
endif()

# Packages are installed once for each lock file.
file(SHA256 ${SOURCE}/package-lock.json lock)
set(installed "")
if(EXISTS ${WORK}/node_modules/.lock)
  file(READ ${WORK}/node_modules/.lock installed)
endif()
if(NOT installed STREQUAL lock)
  file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json DESTINATION ${WORK})
  execute_process(
    COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --fetch-retries=1 --loglevel=error
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE log ERROR_VARIABLE log)
  if(NOT result EQUAL 0)
    give_up("npm ci failed, which needs the network once:\n${log}")
    return()
  endif()
  file(WRITE ${WORK}/node_modules/.lock ${lock})
endif()

set(ENV{NODE_PATH} ${WORK}/node_modules)  # where esbuild looks for three.js
foreach(part src/main.js style.css)
  get_filename_component(name ${part} NAME)
  execute_process(
    COMMAND ${WORK}/node_modules/.bin/esbuild ${part} --bundle --minify --charset=utf8 --format=iife --loader:.glsl=text --loader:.h=text
            --legal-comments=inline --log-level=warning --outfile=${WORK}/${name}
    WORKING_DIRECTORY ${SOURCE} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "esbuild failed on ${SOURCE}/${part}")
  endif()
endforeach()

file(READ ${SOURCE}/page.html page)
file(READ ${WORK}/style.css style)
file(READ ${WORK}/main.js script)
string(REPLACE "/* style */" "${style}" page "${page}")
string(REPLACE "/* script */" "${script}" page "${page}")
file(WRITE ${OUTPUT} "${page}")
file(TOUCH ${STAMP})
