MODULE @MODULE@
  ! @TITLE@
  ! For a controller with the nominal model: switch Absolute Accuracy off.
  ! A call computes CalcJointT and @OPERATIONS@ operations @USUAL@ times as a rule, @ROUNDS@ times at most.

  FUNC robtarget @FUNCTION@(robtarget p,PERS tooldata tool,PERS wobjdata wobj)
    VAR robtarget moved;
    VAR jointtarget first;
    VAR jointtarget now;
    VAR pose frame;
    VAR pose back;
    VAR pos at;
    VAR pos shift;
    VAR pos turn;
    VAR pos oldShift:=[0,0,0];
    VAR pos oldTurn:=[0,0,0];
    VAR pos dShift;
    VAR pos dTurn;
    VAR num w;
    VAR num left;
    IF (NOT tool.robhold) OR wobj.robhold OR (NOT wobj.ufprog) TaskcalStop "tool or part is not fixed";
@AXES@
    frame:=PoseMult(wobj.uframe,wobj.oframe);
    at:=PoseVect(frame,p.trans);
    back:=PoseInv(frame);
    back.trans:=[0,0,0];
    moved:=p;
    first:=CalcJointT(p,tool\WObj:=wobj);
    now:=first;
    FOR k FROM 1 TO @ROUNDS@ DO
      TaskcalShift now.robax,at,shift,turn;
      IF Sqrt(shift.x*shift.x+shift.y*shift.y+shift.z*shift.z)>@SHIFT@ TaskcalStop "it would move too far";
      w:=1-turn.x*turn.x-turn.y*turn.y-turn.z*turn.z;
      IF w<@COSINE@ TaskcalStop "it would turn too far";
      w:=Sqrt(w);
      shift:=PoseVect(back,shift);
      turn:=PoseVect(back,turn);
      moved.trans:=p.trans+shift;
      moved.rot.q1:=w*p.rot.q1-turn.x*p.rot.q2-turn.y*p.rot.q3-turn.z*p.rot.q4;
      moved.rot.q2:=w*p.rot.q2+turn.x*p.rot.q1+turn.y*p.rot.q4-turn.z*p.rot.q3;
      moved.rot.q3:=w*p.rot.q3+turn.y*p.rot.q1+turn.z*p.rot.q2-turn.x*p.rot.q4;
      moved.rot.q4:=w*p.rot.q4+turn.z*p.rot.q1+turn.x*p.rot.q3-turn.y*p.rot.q2;
      dShift:=shift-oldShift;
      dTurn:=turn-oldTurn;
      left:=Abs(dShift.x)+Abs(dShift.y)+Abs(dShift.z)+@LEVER_MM@*(Abs(dTurn.x)+Abs(dTurn.y)+Abs(dTurn.z));
      IF left<@SETTLED_MM@ RETURN moved;
      oldShift:=shift;
      oldTurn:=turn;
      now:=CalcJointT(moved,tool\WObj:=wobj);
@JOINTS@
    ENDFOR
    TaskcalStop "near a singular posture";
    RETURN p;
  ENDFUNC

  ! Half of the rotation, and the shift at a place in the world, millimetres, that the nominal robot needs at joints j.
  LOCAL PROC TaskcalShift(robjoint j,pos at,INOUT pos shift,INOUT pos turn)
    VAR num q{6};
    VAR num t{@VARIABLES@};
@BODY@
  ENDPROC

  LOCAL PROC TaskcalStop(string why)
    ErrWrite "Target is not corrected",why;
    EXIT;
  ENDPROC
ENDMODULE
