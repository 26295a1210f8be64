# SPDX-License-Identifier: Apache-2.0
# SPDX-FileCopyrightText: The Cairn developers
# Read by ctest at its start: queries the test program, PROGRAM, for its tests. The tests of a suite run in one process,
# since a start takes longer than most tests; long tests are listed here and run one by one, so that they spread over
# all cores, and so do tests that are skipped without recordings.
#
# LEFT_OUT: gtest patterns of tests for features missing in this build (CAIRN_OPENNI, CAIRN_VIEWER).
#
# Labels: quick or slow; long (30 s and more, without recordings), data (needs recordings beside the project's folder),
# program (runs cairn as a user does), subgroups (sums with subgroups of 4 and 16), browser and packaging in
# CMakeLists.txt, and python in python/CMakeLists.txt.
cmake_minimum_required(VERSION 3.25)
if(NOT EXISTS "${PROGRAM}")
  add_test(cairn_tests_is_not_built "${PROGRAM}")
  return()
endif()

# Tests that run separately, with their approximate time in seconds. From 5 s on a test is slow; the longest start
# first.
set(single
    "^Real/Recording\\." 60
    "^VerdictOfARecording\\." 10
    "^Calibrate\\." 25
    "^Robustness\\.InertialSensors" 60
    "^Robustness\\." 20
    "^Session\\." 20
    "^Program\\." 10
    "^Export\\." 10
    "^Live\\." 12
    "^Record\\." 5
    "^Sensors\\." 8
    "^Ros2\\." 12
    "^Esdf\\.EqualsARebuildAllAlongARecording" 40
    "PoseGraphBenchmark\\." 10
    "^EvaluateTrajectory\\.AgreesWithTheTumBenchmarkTools|^OpenNi\\.Re(ads|fuses)A|^IclNuim\\.Undoes" 1)
# Suites with a long total time: their shared setup takes longer than the tests.
set(long_suites Numbers 50 Signals 35 GivenPoses 15 Inputs 30 Disk/FaultsOfARun 35 Faults 45 Outputs 50 Ending 30 Bundle 40
                VerdictOfARoom 10 Kills 30 KeyframeDatabase 20 Mapper 20 ImageSizes 20 FaultyDevice 15 ImageSizesAtTheirLimits 10
                SessionFiles 10 Each/WrittenLayout 45 Views 40 ViewedMap 30 Layouts 8 VirtualSensors 20 Ros2Topics 35 Convert 8 ZipRecording 8 CommandLine 40 Splat 60 SplatTrainer 10 SplatRasterizer 10
                MapOfParts 40 PosesOfARecording 20 PosesOfARoom 15 FloorPlan 20 BackEnd 20 Esdf 15 UprightMap 15 JudgedMap 15 Rig 15
                WrittenSigma 15 All/EveryScene 12 ChangedRoom 10 IncrementalMesher 10 Refine 10 LoggedRun 9 Change 8 HeldOutFrames 8
                ReturnToStart 8 LiveSource 8 Quality 60 Calibration 60 RosSource 12 DisturbedRun 7 Finish 7 FreeSpace 7 Tracker 7 GraphScheduler 7 PlannedBuilding 6
                TiltedRoom 6 NetworkRun 20 Each/NetworkCamera 18)
set(data "^Real/Recording\\.|^VerdictOfARecording|PoseGraphBenchmark|AllAlongARecording|^EvaluateTrajectory\\.Agrees|^OpenNi\\.Re(ads|fuses)A|^IclNuim\\.Undoes")
set(program "^(Program|Session|Export|Live|Record|Sensors|Ros2|Real/Recording)\\.|^(Faults|Disk/FaultsOfARun|GivenPoses|Inputs|Kills|Numbers|Signals|Outputs|CommandLine|MapOfParts|PlannedBuilding|Ending|Convert|Layouts|Views|Splat|ViewedMap|ZipRecording|NetworkRun)$")
# Tests that measure time or depend on concurrent threads: run alone.
set(alone "^Live\\.MapsASensor|^Record\\.|^Sensors\\.|^Ros2|^VirtualSensors|^LiveSource")
# Suites of kernels with sums in subgroups.
set(kernels Align IcpReduce PhotometricReduce Tracker Device)

function(add name filter seconds)
  add_test("${name}" "${PROGRAM}" "--gtest_filter=${filter}" --gtest_brief=1)
  set(labels ${ARGN})
  if(seconds LESS 5)
    list(APPEND labels quick)
  else()
    list(APPEND labels slow)
  endif()
  foreach(label data program)
    if(name MATCHES "${${label}}")
      list(APPEND labels ${label})
    endif()
  endforeach()
  if(NOT seconds LESS 30 AND NOT "data" IN_LIST labels)
    list(APPEND labels long)
  endif()
  set_tests_properties("${name}" PROPERTIES LABELS "${labels}" COST ${seconds} TIMEOUT 600)
  if("data" IN_LIST labels)  # quoted: `data` is a variable
    set_tests_properties("${name}" PROPERTIES SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\] 1 test")
  endif()
  if(name MATCHES "${alone}")
    set_tests_properties("${name}" PROPERTIES PROCESSORS 2)
  endif()
endfunction()

execute_process(COMMAND "${PROGRAM}" --gtest_list_tests --gtest_filter=-${LEFT_OUT} OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE "[ ]*#[^\n]*" "" listed "${listed}")  # what a parameter is
string(REPLACE "\n" ";" listed "${listed}")
set(suites)
foreach(line IN LISTS listed)
  if(line MATCHES "^([^ ]+)\\.$")
    set(suite ${CMAKE_MATCH_1})
    list(APPEND suites ${suite})
    set(together_${suite} OFF)
    set(single_${suite})
  elseif(line MATCHES "^  (.+)$")
    set(test ${suite}.${CMAKE_MATCH_1})
    set(rest ${single})
    set(seconds)
    while(rest AND NOT seconds)
      list(POP_FRONT rest pattern cost)
      if(test MATCHES "${pattern}")
        set(seconds ${cost})
      endif()
    endwhile()
    if(seconds)
      list(APPEND single_${suite} ${test})
      add(${test} ${test} ${seconds})
    else()
      set(together_${suite} ON)
    endif()
  endif()
endforeach()

foreach(suite IN LISTS suites)
  if(together_${suite})
    list(JOIN single_${suite} ":" others)
    set(seconds 1)
    list(FIND long_suites ${suite} at)
    if(NOT at EQUAL -1)
      math(EXPR at "${at} + 1")
      list(GET long_suites ${at} seconds)
    endif()
    add(${suite} "${suite}.*-${others}:${LEFT_OUT}" ${seconds})
  endif()
endforeach()

# Other devices have other subgroup sizes. The driver's kernel cache ignores the size, so each size has its own cache.
set(filter)
set(others)
foreach(suite IN LISTS kernels)
  list(APPEND filter ${suite}.*)
  list(APPEND others ${single_${suite}})
endforeach()
list(JOIN filter ":" filter)
list(JOIN others ":" others)
foreach(width 128 512)
  math(EXPR size "${width} / 32")
  set(name Sums.InSubgroupsOf${size})
  add(${name} "${filter}-${others}" 15 subgroups)
  set_tests_properties(${name} PROPERTIES ENVIRONMENT
    "LP_NATIVE_VECTOR_WIDTH=${width};MESA_SHADER_CACHE_DIR=${FOLDER}/shader-cache-${width}")
endforeach()
